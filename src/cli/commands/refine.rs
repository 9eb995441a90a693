//! `tunnelstitch refine`: refines the poses of a survey by photometric bundle adjustment.

use crate::cli::arguments::{PoseReadingArguments, ResumeArguments, positive, rate, resume, share};
use crate::cli::commands::overlay::leave_out_overlay;
use crate::cli::commands::refine_files::stage_refined;
use crate::cli::commands::refine_memory::check_memory;
use crate::cli::output::{Failure, RUN_FILE, RunRecord, Terminal, json, record};
use crate::files::printed;
use crate::persist::atomic;
use crate::progress::Progress;
use crate::refine::{
    CalibrationReport, FrameFlag, FrameReport, Photometry, ReadoutEstimate, RefineOptions,
    RefineReport, Refined, ShapeMode, search_readings,
};
use crate::report::{REFINEMENT_FILE, SECTIONS_FILE};
use crate::survey::{CalibrationGroup, Survey};
use std::path::PathBuf;
use std::sync::Arc;

/// Refines the poses of a survey by photometric bundle adjustment.
///
/// Reads SURVEY/survey.toml and writes into DIR: poses.tum (camera to world, for evo and other
/// programs that read TUM), refine.json (costs, residuals, gains, 1-σ of every frame, timings) and
/// covariance.csv (6 × 6 covariances of every frame and of neighbours) and masked.json (wall where
/// frames show something else and are left out); shape.json and sections.csv (best-fit circle,
/// ovality, convergence chords along the tunnel, with 1-σ) if the wall deviates from the given
/// shape. If the run is interrupted, the same command continues it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch refine my-survey --out refined\n  \
    tunnelstitch refine my-survey --out refined --calibrate focal,radius")]
pub struct RefineArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// Folder for the results; created if missing.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Stop the last solve at the first step shorter than 0.1 px or twice the uncertainty, usually
    /// its first: faster, slightly less accurate.
    #[arg(long)]
    fast: bool,
    /// Solve once more for the poses jointly with the wall's texture at a third of a pixel. On
    /// walls with sharp edges, as bricks, it removes about a third of the error and takes ten to
    /// twenty times as long. A wall that is smooth over a pixel gains nothing and is refined
    /// without it.
    #[arg(long, conflicts_with = "fast")]
    joint: bool,
    /// Self-calibration: also estimate these parameters, separated by commas. The section calibrate
    /// of survey.toml holds the 1-σ of the given values. Writes camera.json and survey.toml into
    /// DIR, for the other commands.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    calibrate: Option<Vec<CalibrateArgument>>,
    /// Shape of the wall: auto estimates how the wall deviates from the drawing, and the lens with
    /// it, as far as the frames show it, and writes shape.json; fixed takes both as given.
    #[arg(long, value_name = "MODE", value_enum, default_value_t = ShapeArgument::Auto)]
    shape: ShapeArgument,
    /// Light: model estimates gain and bias of every frame and a shading that all have in common;
    /// normalised compares contrast relative to its surroundings, whatever the light (lamps near
    /// the wall, sheen, flicker, unknown tone curves), and is a little less exact; auto tries the
    /// model first, and normalises if less than half of the frames fit it.
    #[arg(long, value_name = "MODE", value_enum, default_value_t = PhotometryArgument::Auto)]
    photometry: PhotometryArgument,
    /// Points of the wall that a scanner or a depth camera has measured, in the world of the
    /// initial poses, metres: .ply, .las, .laz, .pcd, or text with x y z in each line. The wall is
    /// fitted to them, robustly: frames refine that shape (with --shape fixed, they take it as it
    /// is). Instead of tunnel.points of survey.toml.
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Largest number of Gauss–Newton iterations of each global solve.
    #[arg(
        long,
        value_name = "N",
        default_value_t = RefineOptions::default().max_iterations,
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    max_iterations: u64,
    /// Largest 1-σ of a photometric frame against those that show the same wall, pixels. Frames
    /// that are less certain keep their poses by the prior.
    #[arg(
        long,
        value_name = "X",
        default_value_t = RefineOptions::default().max_sigma_px,
        value_parser = positive
    )]
    max_sigma_px: f64,
    /// Rate of false alarms of the whole survey: the tests of frames, of aliases and of the prior
    /// share it.
    #[arg(
        long,
        value_name = "RATE",
        default_value_t = RefineOptions::default().false_alarm_rate,
        value_parser = rate
    )]
    false_alarm_rate: f64,
    /// Smallest share of photometric frames, as 90%: with fewer, exit code 4, after everything is
    /// written. (Without a single one, and where refined steps contradict the initial ones, the
    /// exit code is 4 in any case.)
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_photometric: Option<f64>,
    #[command(flatten)]
    reading: PoseReadingArguments,
    #[command(flatten)]
    resume: ResumeArguments,
}

/// Names of modes for `--shape`.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum ShapeArgument {
    /// Estimated with the poses.
    Auto,
    /// As given.
    Fixed,
}

impl From<ShapeArgument> for ShapeMode {
    fn from(mode: ShapeArgument) -> Self {
        match mode {
            ShapeArgument::Auto => Self::Estimated,
            ShapeArgument::Fixed => Self::Fixed,
        }
    }
}

/// Names of modes for `--photometry`.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PhotometryArgument {
    /// By the model, or, where the light defies it, by local normalisation.
    Auto,
    /// Gain and bias of every frame, and a common shading.
    Model,
    /// By local normalisation.
    Normalised,
}

impl From<PhotometryArgument> for Photometry {
    fn from(mode: PhotometryArgument) -> Self {
        match mode {
            PhotometryArgument::Auto => Self::Auto,
            PhotometryArgument::Model => Self::Model,
            PhotometryArgument::Normalised => Self::Normalised,
        }
    }
}

/// Names of parameters for `--calibrate`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum CalibrateArgument {
    /// Focal length; a common factor of fx and fy.
    Focal,
    /// Principal point.
    Centre,
    /// Radial distortion, k1 and k2.
    Distortion,
    /// The tunnel's radius.
    Radius,
    /// Position and direction of the tunnel's axis in the frame of the initial poses.
    Axis,
    /// All of these.
    All,
}

impl CalibrateArgument {
    /// Groups of parameters for the library.
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

/// Runs the command.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn run(
    arguments: &RefineArguments,
    record: &RunRecord,
    terminal: &Arc<Terminal>,
) -> Result<(), Failure> {
    let options = arguments.options();
    let points = arguments.points.as_deref();
    let mut survey = (arguments.reading).open(&arguments.survey, points, terminal)?;
    let inputs = record::hash_survey(&survey, None)?;
    let origin = resume::origin(&survey, &options, inputs.clone())?;
    let say = |text: &str| terminal.say(text);
    check_memory(&survey)?;
    atomic::create_folder(&arguments.out)?;
    let result = arguments.out.join("refine");
    let (refined, json) = arguments.resume.run(&result, &origin, say, |checkpoint| {
        // After the check that the run to be continued is of the same frames.
        let overlay = leave_out_overlay(&mut survey, terminal)?;
        let (refined, json, mut outputs) = stage_refined(
            &survey,
            &overlay,
            &options,
            &arguments.out,
            record,
            Some(checkpoint),
            terminal,
        )?;
        record.add_to(&mut outputs, &arguments.out.join(RUN_FILE), &inputs)?;
        outputs.commit()?;
        Ok((refined, json))
    })?;
    // Frames that fit at two places are read rightly.
    if 2 * count_flagged(&refined.report, FrameFlag::Prior) > survey.frames.len() {
        warn_of_reading(&survey, terminal)?;
    }
    if terminal.is_json() {
        json::print_text(&json)?;
    } else {
        print_summary(&refined, terminal);
        print_outputs(arguments, &refined.report, terminal);
    }
    conclude(arguments, &refined.report, terminal)
}

/// Says in one sentence whether the result may be used; fails if it may not, or if fewer frames are
/// photometric than asked for.
fn conclude(
    arguments: &RefineArguments,
    report: &RefineReport,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let verdict = &report.verdict;
    let share = verdict.photometric as f64 / verdict.frames as f64;
    if verdict.photometric == 0 {
        return Err(Failure::quality(verdict.sentence.clone()));
    }
    if let Some(min) = arguments.min_photometric.filter(|min| share < *min) {
        return Err(Failure::quality(format!(
            "{:.1} % of the frames are photometric, fewer than --min-photometric {}%; {}",
            100.0 * share,
            100.0 * min,
            verdict.sentence
        )));
    }
    terminal.say(&verdict.sentence);
    Ok(())
}

impl RefineArguments {
    /// Options for the library.
    fn options(&self) -> RefineOptions {
        RefineOptions {
            max_iterations: self.max_iterations,
            max_sigma_px: self.max_sigma_px,
            false_alarm_rate: self.false_alarm_rate,
            calibrate: self
                .calibrate
                .as_ref()
                .map(|list| list.iter().flat_map(|group| group.groups()).collect()),
            joint: self.joint,
            shape: self.shape.into(),
            photometry: self.photometry.into(),
            ..if self.fast {
                RefineOptions::fast()
            } else {
                RefineOptions::default()
            }
        }
    }
}

fn count_flagged(report: &RefineReport, flag: FrameFlag) -> usize {
    let frames = report.frames.iter();
    frames.filter(|frame| frame.flag == flag).count()
}

/// Searches for a reading of poses and pictures that the frames agree with, and warns if there is
/// one.
fn warn_of_reading(survey: &Survey, terminal: &Terminal) -> Result<(), Failure> {
    terminal.start("readings", 1);
    let found = search_readings(survey);
    terminal.finish();
    if let Some(found) = found? {
        terminal.warn(found.sentence());
    }
    Ok(())
}

/// Prints the files that were written, and how to continue.
fn print_outputs(arguments: &RefineArguments, report: &RefineReport, terminal: &Terminal) {
    let is_joint = report.levels.iter().any(|level| level.joint);
    if arguments.joint && !is_joint {
        terminal.say(
            "  refined without --joint: the wall is smooth, so it has no detail below a pixel to \
             estimate",
        );
    }
    let out = printed(&arguments.out);
    let poses = arguments.out.join("poses.tum");
    terminal.say(format!(
        "wrote {} and {}",
        printed(&poses),
        printed(&arguments.out.join(REFINEMENT_FILE))
    ));
    if report.photometry == Photometry::Normalised {
        terminal.say(
            "frames were compared by their contrast, normalised locally: the light is not that of \
             a model with gain, bias and one shading for all",
        );
    }
    if let Some(points) = &report.points {
        terminal.say(points.sentence());
    }
    if let Some(bend) = &report.bend {
        terminal.say(format!(
            "the tunnel bends towards {:.0}° with a radius of {:.0} ± {:.0} m (1-σ); poses and \
             chainage are along the bend",
            bend.towards_deg, bend.radius_m, bend.radius_sigma_m
        ));
    }
    let shape = report
        .shape
        .as_ref()
        .filter(|shape| !shape.scales.is_empty());
    if let Some(shape) = shape.filter(|_| arguments.out.join(SECTIONS_FILE).is_file()) {
        terminal.say(format!(
            "the wall deviates from the given shape by {:.1} mm (root mean square): {} has its \
             sections, `tunnelstitch report` draws them",
            shape.rms_mm,
            printed(&arguments.out.join(SECTIONS_FILE))
        ));
    }
    let none_above_mm = report.shape.as_ref().and_then(|s| s.none_above_mm());
    if let Some(none_above_mm) = none_above_mm {
        terminal.say(format!(
            "no deformation of the wall is seen; {none_above_mm:.2} mm (root mean square) would be"
        ));
    }
    if let Some(masked) = report.masked.as_ref().filter(|masked| masked.area_m2 > 0.0) {
        terminal.say(format!(
            "most frames show something else than the wall on {:.2} m² ({:.2} %): left out, listed \
             in {REFINEMENT_FILE}, drawn by stitch --maps",
            masked.area_m2,
            100.0 * masked.share
        ));
    }
    terminal.say(report.scale.sentence());
    if report.calibration.is_some() {
        terminal.say(format!(
            "{out} is a survey with the refined calibration: tunnelstitch stitch {out} --poses {} \
             --out panorama.png",
            printed(&poses)
        ));
    }
}

/// Prints the estimated parameters of the self-calibration.
fn print_calibration(calibration: &CalibrationReport, terminal: &Terminal) {
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
            let name = unknown.name;
            terminal.warn(format!("  {name} keeps its given value: {reason}"));
        }
    }
}

/// Warning about a residual that grows along the rows, with the remedy.
fn rolling_shutter_warning(rows: &ReadoutEstimate) -> String {
    let remedy = if rows.given_ms == 0.0 {
        format!(
            "if the camera has a rolling shutter, give [camera] readout_ms = {:.1} in survey.toml",
            rows.estimate_ms
        )
    } else {
        format!(
            "not {} ms as given; check [camera] readout_ms and the times of the initial poses",
            rows.given_ms
        )
    };
    format!(
        "rolling-shutter test: all frames have the same systematic residual along the rows, \
         {:.1} px from the first row to the last, equal to a readout time of {:.1} ms (1-σ {:.2}): \
         {remedy}",
        rows.shift_px, rows.estimate_ms, rows.sigma_ms
    )
}

/// Prints solves, uncertainty, timings and rejected frames of a refinement.
pub fn print_summary(refined: &Refined, terminal: &Terminal) {
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
            if level.joint {
                "  jointly with the wall"
            } else {
                ""
            }
        ));
    }
    let mean = |value: &dyn Fn(&FrameReport) -> f64| {
        report.frames.iter().map(value).sum::<f64>() / report.frames.len() as f64
    };
    terminal.say(format!(
        "  stopped: {}\n  mean 1-σ: rotation {:.4}°, translation {:.2} mm, on the wall {:.2} mm \
         ({:.3} px)",
        report.stopped_because,
        mean(&|f| f.sigma.rotation_deg),
        1e3 * mean(&|f| f.sigma.translation_m),
        1e3 * mean(&|f| f.sigma.wall_m),
        mean(&|f| f.sigma.wall_px),
    ));
    if let Some(calibration) = &report.calibration {
        print_calibration(calibration, terminal);
    }
    if let Some(rows) = report.rolling_shutter.filter(|rows| rows.systematic) {
        terminal.warn(rolling_shutter_warning(&rows));
    }
    let seconds: f64 = report.timings.iter().map(|t| t.seconds).sum();
    let stages: Vec<String> = report
        .timings
        .iter()
        .map(|t| format!("{} {:.2} s", t.stage, t.seconds))
        .collect();
    terminal.say(format!("  {seconds:.2} s: {}", stages.join(", ")));
    for finding in &report.prior_test.findings {
        terminal.warn(format!("  {finding}"));
    }
    if let Some(found) = &report.model_error {
        terminal.say(format!(
            "  residuals go together over {:.2} m of the wall, more than by noise: σ includes \
             errors of lens, shape or light as far as they show",
            found.patch_m
        ));
    }
    if report.frames_on_prior > 0 {
        terminal.warn(format!(
            "{} of {} frames are rejected, so their poses rest on the prior:",
            report.frames_on_prior,
            report.frames.len()
        ));
        let contradicts = report.prior_test.contradicting_scale().is_some();
        if report.frames_on_prior == report.frames.len() && !contradicts {
            terminal.warn(explain_failure(report));
        }
        warn_of_rejected_frames(report, terminal);
    }
}

/// Possible causes where no frame is photometric.
fn explain_failure(report: &RefineReport) -> &'static str {
    if 2 * count_flagged(report, FrameFlag::Ambiguous) > report.frames.len() {
        "  no frame is photometric: the wall repeats itself, and the initial poses are too \
         uncertain to tell its repetitions apart; more exact ones, with a smaller σ under \
         [prior], do"
    } else {
        "  no frame is photometric; possible causes: too few overlapping frames, a wall without \
         texture, poses in another convention (--pose-convention, --camera-axes, --tunnel-frame), \
         a wrong radius_m, calibration or [prior], or a mask or tunnel.ignore that leaves nothing \
         to compare"
    }
}

/// Largest number of warnings about rejected frames.
const MAX_REJECTION_WARNINGS: usize = 24;

/// Warns of rejected frames with the reason; consecutive frames with the same reason share a line.
fn warn_of_rejected_frames(report: &RefineReport, terminal: &Terminal) {
    let frames = report.frames.iter();
    let rejected: Vec<(&FrameReport, &str)> = frames
        .filter(|frame| frame.flag != FrameFlag::Photometric)
        .filter_map(|frame| Some((frame, frame.reason.as_deref()?)))
        .collect();
    let mut runs =
        rejected.chunk_by(|(a, reason), (b, next)| b.index == a.index + 1 && reason == next);
    for run in runs.by_ref().take(MAX_REJECTION_WARNINGS) {
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
            "  … and {left} more; refine.json has the reason of each"
        ));
    }
}
