//! Execution of a sweep.

use crate::converge::error::ConvergeError;
use crate::converge::feasible_survey::draw_survey;
use crate::converge::majority_error::majority_error;
use crate::converge::options::ConvergeOptions;
use crate::converge::run_log::{RunLog, count_finished};
use crate::converge::run_record::RunRecord;
use crate::converge::success_map::draw_success_map;
use crate::converge::summary::{CellSummary, Convergence};
use crate::converge::sweep_cell::SweepCell;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use tunnelstitch_core::frames::{PictureFormat, write_picture};
use tunnelstitch_core::persist::atomic::{self, ScratchFolder};
use tunnelstitch_core::progress::{Progress, Silent};
use tunnelstitch_core::survey::Survey;
use tunnelstitch_geometry::trajectory::poses_of;
use tunnelstitch_refine::{FrameFlag, RefineOptions, Refined, refine};
use tunnelstitch_simulate::SimulateOptions;

/// Name of the log of runs.
const LOG_FILE: &str = "runs.jsonl";

/// Outcome of a call of [`run_sweep`].
#[derive(Clone, Debug)]
pub struct SweepOutcome {
    /// The result of the whole sweep.
    pub result: Convergence,
    /// The text of converge.json.
    pub json: String,
    /// Number of runs that this call executed.
    pub done: usize,
    /// Number of runs found in the log.
    pub kept: usize,
}

/// Executes all runs of a sweep that are not yet in `out`/runs.jsonl, and writes the summaries.
///
/// Each run is appended to runs.jsonl; converge.json, converge.txt and converge.png follow at the
/// end. `discard` removes the runs of earlier calls. The runs go seed by seed through all cells, so
/// that an interrupted sweep has about as many runs of every cell. Except for durations, the result
/// does not depend on interruptions or the number of threads.
///
/// # Errors
/// [`ConvergeError`]. Finished runs are in the log in any case.
pub fn run_sweep(
    options: &ConvergeOptions,
    out: &Path,
    discard: bool,
    progress: &dyn Progress,
) -> Result<SweepOutcome, ConvergeError> {
    options.validate()?;
    atomic::create_folder(out)?;
    let mut log = RunLog::open(&out.join(LOG_FILE), &options.settings(), discard)?;
    let cells = options.cells();
    let missing: Vec<(&SweepCell, u64)> = all_runs(&cells, options.seeds)
        .filter(|(cell, seed)| log.find(cell, *seed).is_none())
        .collect();
    progress.start("experiments", missing.len());
    for (cell, seed) in &missing {
        progress.detail(&format!("{cell}, seed {seed}"));
        log.append(run_experiment(options, cell, *seed, out)?)?;
        progress.advance(1);
    }
    progress.finish();

    let summaries = cells
        .iter()
        .map(|cell| {
            let runs: Vec<&RunRecord> = (1..=options.seeds)
                .filter_map(|seed| log.find(cell, seed))
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
        &draw_success_map(&result).into(),
        PictureFormat::Png,
    )?;
    Ok(SweepOutcome {
        result,
        json,
        done: missing.len(),
        kept: cells.len() * options.seeds as usize - missing.len(),
    })
}

/// Numbers of runs of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepPlan {
    /// Runs that [`run_sweep`] would execute.
    pub missing: usize,
    /// Runs that are in the log already.
    pub kept: usize,
}

/// Counts the runs that [`run_sweep`] would execute; writes nothing.
///
/// # Errors
/// [`ConvergeError`], as far as it is known before the first run.
pub fn plan_sweep(
    options: &ConvergeOptions,
    out: &Path,
    discard: bool,
) -> Result<SweepPlan, ConvergeError> {
    options.validate()?;
    atomic::check_folder(out)?;
    let cells = options.cells();
    let runs = all_runs(&cells, options.seeds);
    let kept = if discard {
        0
    } else {
        count_finished(&out.join(LOG_FILE), &options.settings(), runs)?
    };
    Ok(SweepPlan {
        missing: cells.len() * options.seeds as usize - kept,
        kept,
    })
}

/// All runs of a sweep, seed by seed.
fn all_runs(cells: &[SweepCell], seeds: u64) -> impl Iterator<Item = (&SweepCell, u64)> {
    (1..=seeds).flat_map(move |seed| cells.iter().map(move |cell| (cell, seed)))
}

/// Draws, simulates, refines and evaluates one survey, with its files in a scratch folder in `out`.
///
/// # Errors
/// [`ConvergeError`]; a survey that the refinement refuses is a result, not an error.
fn run_experiment(
    options: &ConvergeOptions,
    cell: &SweepCell,
    seed: u64,
    out: &Path,
) -> Result<RunRecord, ConvergeError> {
    let drawn = draw_survey(options, cell, seed)?;
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
        Some(survey) => simulate_and_refine(survey, out, &mut record)?,
        None => {
            record.error = Some(format!(
                "none of {} draws could be flown: the poses leave the tunnel or look along it",
                drawn.redraws + 1
            ));
        }
    }
    Ok(record)
}

/// Simulates and refines a survey and records the outcome.
///
/// # Errors
/// [`ConvergeError`]; a survey that the refinement refuses is a result, not an error.
fn simulate_and_refine(
    survey: &SimulateOptions,
    out: &Path,
    record: &mut RunRecord,
) -> Result<(), ConvergeError> {
    let scratch = ScratchFolder::inside(out)?;
    let folder = scratch.path().join("survey");
    tunnelstitch_simulate::write_survey(survey, &folder, false, &Silent)?;
    let survey = Survey::open(&folder)?;
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let since = Instant::now();
    let refined = refine(&survey, &RefineOptions::default(), &silent);
    record.seconds = since.elapsed().as_secs_f64();
    match refined {
        Ok(refined) => record_accuracy(&survey, &refined, record),
        Err(error) => {
            record.error = Some(error.to_string());
            Ok(())
        }
    }
}

/// Records the accuracy of the refined poses and the reliability of their flags.
///
/// # Errors
/// [`ConvergeError::Evaluate`] for a survey without true poses, which the simulator never makes.
fn record_accuracy(
    survey: &Survey,
    refined: &Refined,
    record: &mut RunRecord,
) -> Result<(), ConvergeError> {
    let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
    let poses = poses_of(&refined.trajectory);
    let error = majority_error(survey.surface.as_ref(), &survey.cameras, &poses, &truth)?;
    let finite = |px: f64| px.is_finite().then_some(px);
    let is_photometric = |flag: FrameFlag| flag == FrameFlag::Photometric;
    let frames = &refined.report.frames;
    record.refined = true;
    record.worst_frame_px = finite(error.worst_px());
    record.rms_px = finite(error.rms_px());
    record.good_frames = error.good_count();
    record.success = record.good_frames == poses.len();
    record.flagged_frames = frames
        .iter()
        .filter(|frame| !is_photometric(frame.flag))
        .count();
    record.false_successes = error.false_successes(frames);
    Ok(())
}
