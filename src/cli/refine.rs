//! `tunnelstitch refine`.

use super::poses::ReadingArguments;
use super::record::{self, RUN_FILE, Run};
use super::resume::{self, ResumeArguments};
use super::{Failure, Terminal, json};
use crate::PROGRAM;
use crate::camera::format_calibration;
use crate::persist::atomic;
use crate::persist::checkpoint::Checkpoint;
use crate::progress::Progress;
use crate::refine::{
    CalibrationReport, FrameFlag, FrameReport, ReadoutEstimate, RefineOptions, RefineReport,
    Refined, refine_with_checkpoint, search_pose_conventions,
};
use crate::survey::{CalibrationGroup, SURVEY_FILE, Survey, SurveyFile};
use crate::trajectory::tum;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Corrects the poses of a survey by photometric consistency.
///
/// Reads SURVEY/survey.toml and writes poses.tum (camera-to-world, for evo and everything else that
/// reads TUM), refine.json (costs, residuals, gains, 1-σ of every frame, timings) and
/// covariance.csv (6 × 6 covariance of every frame and of neighbours) into DIR. Interrupted or
/// killed, the same command goes on where it was.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  tunnelstitch refine my-survey --out refined\n  tunnelstitch refine my-survey --out refined --calibrate focal,radius"
)]
pub struct RefineArguments {
    /// Folder of the survey (with survey.toml), or the file itself.
    survey: PathBuf,
    /// Folder for the results; made if missing.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// End the last solve with the first step shorter than 0.1 px or twice the uncertainty, most
    /// often its first: less time.
    #[arg(long)]
    fast: bool,
    /// Solve once more, for the wall at a third of a pixel jointly with the poses: on walls with
    /// sharp edges, as bricks, about a third of the error goes, in ten to twenty times the time.
    /// Walls that are smooth over a pixel have nothing to gain, and are refined as without it.
    #[arg(long, conflicts_with = "fast")]
    joint: bool,
    /// Estimate what all frames share, too: focal, centre, distortion, radius, axis, or all, with
    /// commas between. How far off the given values may be is said by the section calibrate of
    /// survey.toml. Writes camera.json and survey.toml into DIR, for the other commands.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    calibrate: Option<Vec<CalibrateArgument>>,
    /// Steps of each global solve, at the most.
    #[arg(long, value_name = "N", default_value_t = RefineOptions::default().max_iterations, value_parser = clap::value_parser!(u64).range(1..))]
    max_iterations: u64,
    /// Print refine.json on standard output instead of the summary.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    reading: ReadingArguments,
    #[command(flatten)]
    resume: ResumeArguments,
}

/// What `--calibrate` takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum CalibrateArgument {
    /// Focal length; fx and fy grow alike.
    Focal,
    /// Principal point.
    Centre,
    /// Radial distortion, k1 and k2.
    Distortion,
    /// The tunnel's radius.
    Radius,
    /// Where the frame of the initial poses has the tunnel's axis.
    Axis,
    /// All of these.
    All,
}

impl CalibrateArgument {
    fn groups(self) -> Vec<CalibrationGroup> {
        match self {
            Self::Focal => vec![CalibrationGroup::Focal],
            Self::Centre => vec![CalibrationGroup::Centre],
            Self::Distortion => vec![CalibrationGroup::Distortion],
            Self::Radius => vec![CalibrationGroup::Radius],
            Self::Axis => vec![CalibrationGroup::Axis],
            Self::All => CalibrationGroup::ALL.to_vec(),
        }
    }
}

/// `refine.json`.
#[derive(Serialize)]
struct ReportFile<'a> {
    /// Name and version of the program.
    program: &'static str,
    /// The command line.
    command: &'a [String],
    /// The survey as given, and what its survey.toml says.
    survey: &'a Path,
    survey_file: &'a SurveyFile,
    /// The effective options.
    options: &'a RefineOptions,
    #[serde(flatten)]
    report: &'a RefineReport,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn run(
    arguments: &RefineArguments,
    run: &Run,
    terminal: &Arc<Terminal>,
) -> Result<(), Failure> {
    let options = RefineOptions {
        max_iterations: arguments.max_iterations,
        calibrate: arguments
            .calibrate
            .as_ref()
            .map(|list| list.iter().flat_map(|group| group.groups()).collect()),
        joint: arguments.joint,
        ..if arguments.fast {
            RefineOptions::fast()
        } else {
            RefineOptions::default()
        }
    };
    let survey = arguments.reading.open(&arguments.survey, terminal)?;
    let inputs = record::inputs(&survey, None)?;
    let origin = resume::origin(&survey, &options, inputs.clone())?;
    let say = |text: &str| {
        if !arguments.json {
            terminal.say(text);
        }
    };
    atomic::create_folder(&arguments.out)?;
    let result = arguments.out.join("refine");
    let (refined, json) = arguments.resume.run(&result, &origin, say, |checkpoint| {
        let done = refine_into(
            &survey,
            &options,
            &arguments.out,
            run,
            Some(checkpoint),
            terminal,
        )?;
        run.write(&arguments.out.join(RUN_FILE), &inputs)?;
        Ok(done)
    })?;
    if 2 * refined.report.frames_on_prior > survey.frames.len() {
        terminal.start("other conventions", 1);
        let others = search_pose_conventions(&survey);
        terminal.finish();
        let others = others?;
        if !others.is_empty() {
            terminal.warn(format!(
                "the pictures do not agree with the poses as they are read; they agree with {}",
                others.join(", or with ")
            ));
        }
    }
    if arguments.json {
        json::print_text(&json)?;
    } else {
        summarise(&refined, terminal);
        let solved_for = refined.report.levels.iter().any(|level| level.joint);
        if arguments.joint && !solved_for {
            terminal.say("  refined as without --joint: the wall is so smooth that there is nothing between the pixels to be solved for");
        }
        terminal.say(format!(
            "wrote {} and {}",
            arguments.out.join("poses.tum").display(),
            arguments.out.join("refine.json").display()
        ));
        if refined.report.calibration.is_some() {
            let (out, poses) = (&arguments.out, arguments.out.join("poses.tum"));
            terminal.say(format!(
                "with the refined calibration, {0} is a survey: tunnelstitch stitch {0} --poses {1} --out panorama.png",
                out.display(),
                poses.display()
            ));
        }
    }
    Ok(())
}

/// Refines a survey, going on from a checkpoint if there is one, and writes poses.tum, refine.json
/// and covariance.csv into `out`; returns the text of refine.json too.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn refine_into(
    survey: &Survey,
    options: &RefineOptions,
    out: &Path,
    run: &Run,
    checkpoint: Option<&mut Checkpoint>,
    terminal: &Arc<Terminal>,
) -> Result<(Refined, String), Failure> {
    atomic::create_folder(out)?;
    let survey_section = survey.file.calibrate.as_ref();
    let asked = options
        .calibrate
        .as_ref()
        .or(survey_section.map(|section| &section.unknowns));
    if asked.is_some_and(|groups| !groups.is_empty()) {
        check_apart(&survey.folder, out)?;
    }
    let progress: Arc<dyn Progress> = Arc::clone(terminal) as Arc<dyn Progress>;
    let refined = refine_with_checkpoint(survey, options, checkpoint, &progress)?;
    let json = json::text(&ReportFile {
        program: PROGRAM,
        command: &run.arguments,
        survey: &survey.folder,
        survey_file: &survey.file,
        options,
        report: &refined.report,
    })?;
    atomic::write_text(&out.join("poses.tum"), &tum::format(&refined.trajectory))?;
    atomic::write_text(&out.join("refine.json"), &json)?;
    let sigmas: Vec<_> = refined
        .report
        .frames
        .iter()
        .map(|frame| frame.sigma)
        .collect();
    atomic::write_text(
        &out.join("covariance.csv"),
        &refined.covariances.csv(&sigmas),
    )?;
    if let Some(calibration) = &refined.report.calibration {
        let file =
            calibrated(survey, calibration).map_err(|error| Failure::bug(error.to_string()))?;
        let camera = format_calibration(&calibration.camera);
        atomic::write_text(&out.join(CAMERA_FILE), &camera)?;
        atomic::write_text(&out.join(SURVEY_FILE), &file)?;
    }
    Ok((refined, json))
}

/// Name of the refined calibration.
const CAMERA_FILE: &str = "camera.json";

/// Refuses to write the refined calibration over the survey's own.
fn check_apart(survey: &Path, out: &Path) -> Result<(), Failure> {
    match (survey.canonicalize(), out.canonicalize()) {
        (Ok(survey), Ok(folder)) if survey == folder => Err(Failure::input(format!(
            "{}: with --calibrate, --out must not be the survey's own folder, whose {SURVEY_FILE} would be replaced",
            out.display()
        ))),
        _ => Ok(()),
    }
}

/// The text of a `survey.toml` with the refined calibration and the survey's own frames and poses.
fn calibrated(
    survey: &Survey,
    calibration: &CalibrationReport,
) -> Result<String, toml::ser::Error> {
    let folder = std::path::absolute(&survey.folder).unwrap_or_else(|_| survey.folder.clone());
    let mut file = survey.file.clone();
    for path in file.paths_mut() {
        *path = folder.join(&*path);
    }
    if file.tunnel.is_straight_and_round() {
        file.tunnel.radius_m = Some(calibration.radius_m);
    }
    file.camera.file = CAMERA_FILE.into();
    file.camera.name = None;
    if let Some(images) = &mut file.frames.images {
        let escaped = glob::Pattern::escape(&folder.to_string_lossy());
        let pattern = Path::new(&escaped).join(&*images);
        *images = pattern.to_string_lossy().into_owned();
    }
    if let Some(video) = &mut file.frames.video {
        *video = folder.join(&*video);
    }
    file.calibrate = None;
    file.options.clear();
    Ok(format!(
        "# The survey with the calibration that refine has found.\n{}",
        toml::to_string(&file)?
    ))
}

fn summarise_calibration(calibration: &CalibrationReport, terminal: &Terminal) {
    terminal.say("  calibration              given     estimate          1-σ   (prior 1-σ)");
    for unknown in &calibration.unknowns {
        let unit = match unknown.unit {
            "1" => "",
            unit => unit,
        };
        terminal.say(format!(
            "  {:<13} {:>3} {:>12.5} {:>12.5} {:>12.5}   ({:.5}){}",
            unknown.name,
            unit,
            unknown.initial,
            unknown.estimate,
            unknown.sigma,
            unknown.prior_sigma,
            if unknown.observed {
                ""
            } else {
                "   not observable"
            },
        ));
    }
    for unknown in &calibration.unknowns {
        if let Some(reason) = &unknown.reason {
            terminal.warn(format!("  {} stays as given: {reason}", unknown.name));
        }
    }
}

/// What a systematic residual along the rows looks like, and what to do about it.
fn warn_of_rows(rows: &ReadoutEstimate) -> String {
    let remedy = if rows.given_ms == 0.0 {
        format!(
            "a rolling shutter? give [camera] readout_ms = {:.1} in survey.toml",
            rows.estimate_ms
        )
    } else {
        format!(
            "and not {} ms; check [camera] readout_ms and the times of the initial poses",
            rows.given_ms
        )
    };
    format!(
        "a systematic residual along the rows, the same in all frames: {:.1} px from the first row to the last, as if rows were read \
         over {:.1} ms (1-σ {:.2}): {remedy}",
        rows.shift_px, rows.estimate_ms, rows.sigma_ms
    )
}

/// Prints what the refinement did.
pub fn summarise(refined: &Refined, terminal: &Terminal) {
    let report = &refined.report;
    terminal.say("  level  steps        cost: start → end      observations  noise (grey)");
    for level in &report.levels {
        let solve = &level.solve;
        terminal.say(format!(
            "  {:>5}  {:>5}  {:>12.4e} → {:>11.4e}  {:>12}  {:>12.2}{}",
            level.level,
            solve.iterations,
            solve.cost_start,
            solve.cost_end,
            solve.observations,
            solve.sigma,
            if level.joint { "  with the wall" } else { "" }
        ));
    }
    let mean = |value: &dyn Fn(&FrameReport) -> f64| {
        report.frames.iter().map(value).sum::<f64>() / report.frames.len() as f64
    };
    terminal.say(format!(
        "  stopped: {}\n  mean 1-σ: rotation {:.4}°, translation {:.2} mm, on the wall {:.2} mm ({:.3} px)",
        report.stopped_because,
        mean(&|f| f.sigma.rotation_deg),
        1e3 * mean(&|f| f.sigma.translation_m),
        1e3 * mean(&|f| f.sigma.wall_m),
        mean(&|f| f.sigma.wall_px),
    ));
    if let Some(calibration) = &report.calibration {
        summarise_calibration(calibration, terminal);
    }
    if let Some(rows) = report.rolling_shutter.filter(|rows| rows.systematic) {
        terminal.warn(warn_of_rows(&rows));
    }
    let seconds: f64 = report.timings.iter().map(|t| t.seconds).sum();
    let stages: Vec<String> = report
        .timings
        .iter()
        .map(|t| format!("{} {:.2} s", t.stage, t.seconds))
        .collect();
    terminal.say(format!("  {seconds:.2} s: {}", stages.join(", ")));
    if report.frames_on_prior == 0 {
        terminal.say(format!("  all {} frames improved", report.frames.len()));
    } else {
        terminal.warn(format!(
            "{} of {} frames could not be made sure by their pixels; do not rely on them without their prior:",
            report.frames_on_prior,
            report.frames.len()
        ));
        if report.frames_on_prior == report.frames.len() {
            terminal.warn(
                "  no frame is sure: too few overlapping frames, a wall without texture, poses in another convention \
                 (--pose-convention, --camera-axes, --tunnel-frame), a wrong radius_m, calibration or [prior], or a mask or \
                 tunnel.ignore that leave nothing",
            );
        }
        warn_of_doubts(report, terminal);
    }
}

/// Lines about frames in doubt, at the most.
const MOST_DOUBTS: usize = 24;

/// Says which frames are doubted and why, those in a row with the same reason together.
fn warn_of_doubts(report: &RefineReport, terminal: &Terminal) {
    let frames = report.frames.iter();
    let doubted: Vec<(&FrameReport, &str)> = frames
        .filter(|frame| frame.flag != FrameFlag::Photometric)
        .filter_map(|frame| Some((frame, frame.reason.as_deref()?)))
        .collect();
    let mut runs = doubted.chunk_by(|(a, why), (b, too)| b.index == a.index + 1 && why == too);
    for run in runs.by_ref().take(MOST_DOUBTS) {
        match run {
            [] => {}
            [(frame, reason)] => {
                terminal.warn(format!(
                    "  frame {} ({}): {reason}",
                    frame.index, frame.file
                ));
            }
            [(first, reason), .., (last, _)] => terminal.warn(format!(
                "  frames {} to {} ({} to {}), each: {reason}",
                first.index, last.index, first.file, last.file
            )),
        }
    }
    let left: usize = runs.map(<[_]>::len).sum();
    if left > 0 {
        terminal.warn(format!(
            "  … and {left} more, each with its reason in refine.json"
        ));
    }
}
