//! The sweep itself.

use super::draw::draw;
use super::log::RunLog;
use super::{
    Cell, CellSummary, ConvergeError, ConvergeOptions, Convergence, GOOD_PX, RunRecord,
    majority_error, map,
};
use crate::frames::{PictureFormat, write_picture};
use crate::persist::atomic::{self, ScratchFolder};
use crate::progress::{Progress, Silent};
use crate::refine::{FrameFlag, RefineOptions, Refined, refine};
use crate::simulate::{self, SimulateOptions};
use crate::survey::Survey;
use crate::trajectory::poses_of;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What a call did.
#[derive(Clone, Debug)]
pub struct Swept {
    /// The result of the whole sweep.
    pub result: Convergence,
    /// The text of converge.json.
    pub json: String,
    /// Runs done by this call.
    pub done: usize,
    /// Runs found in the log.
    pub kept: usize,
}

/// Does all runs of a sweep that `out`/runs.jsonl does not hold yet, each into a line of it, then
/// writes converge.json, converge.txt and converge.png there. `afresh` drops the runs of earlier
/// calls.
///
/// The runs go seed by seed through all cells, so that an interrupted sweep knows every cell
/// equally well. Except for times, the result does not depend on interruptions or the number of
/// threads.
///
/// # Errors
/// [`ConvergeError`]. Whatever the error, the runs that are finished are in the log.
pub fn run(
    options: &ConvergeOptions,
    out: &Path,
    afresh: bool,
    progress: &dyn Progress,
) -> Result<Swept, ConvergeError> {
    options.check()?;
    atomic::create_folder(out)?;
    let mut log = RunLog::open(&out.join("runs.jsonl"), &options.settings(), afresh)?;
    let cells = options.cells();
    let missing: Vec<(&Cell, u64)> = (1..=options.seeds)
        .flat_map(|seed| cells.iter().map(move |cell| (cell, seed)))
        .filter(|(cell, seed)| log.run(cell, *seed).is_none())
        .collect();
    progress.start("experiments", missing.len());
    for (cell, seed) in &missing {
        progress.detail(&format!("{cell}, seed {seed}"));
        log.append(experiment(options, cell, *seed, out)?)?;
        progress.advance(1);
    }
    progress.finish();

    let summaries = cells
        .iter()
        .map(|cell| {
            let runs: Vec<&RunRecord> = (1..=options.seeds)
                .filter_map(|seed| log.run(cell, seed))
                .collect();
            CellSummary::of(cell, &runs)
        })
        .collect();
    let result = Convergence::new(options, summaries);
    let json_path = out.join("converge.json");
    let json = serde_json::to_string_pretty(&result)
        .map_err(|error| atomic::WriteError::new(&json_path, std::io::Error::other(error)))?
        + "\n";
    atomic::write_text(&json_path, &json)?;
    atomic::write_text(&out.join("converge.txt"), &format!("{result}\n"))?;
    write_picture(
        &out.join("converge.png"),
        &map::draw(&result).into(),
        PictureFormat::Png,
    )?;
    Ok(Swept {
        result,
        json,
        done: missing.len(),
        kept: cells.len() * options.seeds as usize - missing.len(),
    })
}

/// Draws, simulates, refines and judges one survey. Its files are in a scratch folder inside `out`.
///
/// # Errors
/// [`ConvergeError`]; that the refinement refuses the survey is a result and no error.
fn experiment(
    options: &ConvergeOptions,
    cell: &Cell,
    seed: u64,
    out: &Path,
) -> Result<RunRecord, ConvergeError> {
    let drawn = draw(options, cell, seed)?;
    let mut record = RunRecord {
        settings: options.settings(),
        cell: cell.clone(),
        seed,
        seed_used: drawn.survey.as_ref().map(|survey| survey.seed),
        redraws: drawn.redraws,
        refined: false,
        error: None,
        success: false,
        worst_frame_px: None,
        rms_px: None,
        good_frames: 0,
        flagged_frames: 0,
        false_successes: 0,
        seconds: 0.0,
    };
    match &drawn.survey {
        Some(survey) => fly(survey, out, &mut record)?,
        None => {
            record.error = Some(format!(
                "none of {} draws could be flown: the poses leave the tunnel or look along it",
                drawn.redraws + 1
            ));
        }
    }
    Ok(record)
}

/// Simulates and refines a survey and records what became of it.
///
/// # Errors
/// As [`experiment`].
fn fly(survey: &SimulateOptions, out: &Path, record: &mut RunRecord) -> Result<(), ConvergeError> {
    let scratch = ScratchFolder::inside(out)?;
    let folder = scratch.path().join("survey");
    simulate::write_survey(survey, &folder, false, &Silent)?;
    let survey = Survey::open(&folder)?;
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let since = Instant::now();
    let refined = refine(&survey, &RefineOptions::default(), &silent);
    record.seconds = since.elapsed().as_secs_f64();
    match refined {
        Ok(refined) => judge(&survey, &refined, record),
        Err(error) => {
            record.error = Some(error.to_string());
            Ok(())
        }
    }
}

/// Records how good the refined poses are and whether the refinement knew.
///
/// # Errors
/// [`ConvergeError::Evaluate`] for a survey without true poses, which the simulator never makes.
fn judge(survey: &Survey, refined: &Refined, record: &mut RunRecord) -> Result<(), ConvergeError> {
    let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
    let poses = poses_of(&refined.trajectory);
    let error = majority_error(survey.surface.as_ref(), &survey.camera, &poses, &truth)?;
    let finite = |px: f64| px.is_finite().then_some(px);
    let sure = |flag: FrameFlag| flag == FrameFlag::Photometric;
    let frames = &refined.report.frames;
    record.refined = true;
    record.worst_frame_px = finite(error.worst_px());
    record.rms_px = finite(error.rms_px());
    record.good_frames = error.good();
    record.success = record.good_frames == poses.len();
    record.flagged_frames = frames.iter().filter(|frame| !sure(frame.flag)).count();
    record.false_successes = frames
        .iter()
        .zip(&error.frame_rms_px)
        // What is no number is not good.
        .filter(|(frame, px)| sure(frame.flag) && (px.is_nan() || **px >= GOOD_PX))
        .count();
    Ok(())
}
