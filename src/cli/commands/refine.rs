//! `tunnelstitch refine`: refines the poses of a survey by photometric bundle adjustment.

use crate::check::{JOIN_SHARE, join_bytes, refine_bytes, refine_s, shard_bytes, shard_share};
use crate::cli::arguments::{
    FollowArguments, PoseReadingArguments, ResumeArguments, input_file, output_folder, positive,
    rate, resume, share,
};
use crate::cli::commands::overlay::leave_out_overlay;
use crate::cli::commands::refine_files::{
    FOUND_FILES, REFINED_FILES, check_outputs, stage_refined,
};
use crate::cli::commands::refine_follow::follow;
use crate::cli::commands::refine_memory::check_memory;
use crate::cli::commands::refine_shards::{read_shards, write_shard};
use crate::cli::commands::refine_summary::{print_outputs, print_summary};
use crate::cli::output::{
    DryRunArguments, Failure, Job, RUN_FILE, RunRecord, Terminal, json, record,
};
use crate::follow::PREVIEW_FILES;
use crate::persist::shard_number::ShardNumber;
use crate::refine::{
    Photometry, RefineInput, RefineOptions, RefineReport, ShapeMode, WallPoints, check_input,
};
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
/// shape. Of a rig, poses.tum has the poses of its cameras, one per picture, and poses_body.tum
/// those of its body, one a moment. If the run is interrupted, the same command continues it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch refine my-survey --out refined\n  \
    tunnelstitch refine my-survey --out refined --calibrate focal,radius\n  \
    tunnelstitch refine my-survey --out refined --follow\n\n\
    A long survey in two shards, on two machines, and joined:\n  \
    tunnelstitch refine my-survey --shard 1/2 --out shards\n  \
    tunnelstitch refine my-survey --shard 2/2 --out shards\n  \
    tunnelstitch refine my-survey --join shards --out refined")]
pub struct RefineArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// Folder for the results; created if missing.
    #[arg(long, short, value_name = "DIR", value_parser = output_folder())]
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
    /// initial poses, metres: .ply, .las, .laz, .pcd, or text with x y z in each line, as from
    /// standard input (`-`). The wall is fitted to them, robustly: frames refine that shape (with
    /// --shape fixed, they take it as it is). Instead of tunnel.points of survey.toml.
    #[arg(long, value_name = "FILE", value_parser = input_file())]
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
    /// Refine only shard K of N stretches along the tunnel of as many frames each, counted from 1,
    /// as far as the last solve, and write shard-K-of-N.state into DIR, for --join. It needs the
    /// memory of its own frames and of up to 80 beside them at either end.
    #[arg(long, value_name = "K/N", conflicts_with_all = ["join", "min_photometric", "verbose"])]
    shard: Option<ShardNumber>,
    /// Go on from the shards in FOLDER, all of one division: join them, and solve for all frames
    /// together. The result does not depend on where or in which order the shards were refined.
    #[arg(long, value_name = "FOLDER")]
    join: Option<PathBuf>,
    /// Also print the table of global solves and the time of each stage.
    #[arg(long, short)]
    verbose: bool,
    #[command(flatten)]
    follow: FollowArguments,
    #[command(flatten)]
    reading: PoseReadingArguments,
    #[command(flatten)]
    resume: ResumeArguments,
    #[command(flatten)]
    dry_run: DryRunArguments,
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
    if arguments.follow.follow && !arguments.dry_run.is_set() {
        let (survey, out) = (&arguments.survey, &arguments.out);
        follow(survey, out, &arguments.reading, &arguments.follow, terminal)?;
    }
    let mut survey = (arguments.reading).open(&arguments.survey, points, terminal)?;
    check_outputs(&survey, &arguments.out)?;
    check_memory(&survey, arguments.memory_bytes(&survey))?;
    if arguments.dry_run.is_set() {
        return describe(&survey, &options, arguments)?.print(terminal);
    }
    let inputs = record::hash_survey(&survey, None)?;
    let origin = resume::origin(&survey, &options, inputs.clone())?;
    let say = |text: &str| terminal.say(text);
    if let Some(shard) = arguments.shard {
        let result = arguments.out.join(shard.name());
        return arguments.resume.run(&result, &origin, say, |checkpoint| {
            leave_out_overlay(&mut survey, terminal)?;
            let place = (shard, arguments.out.as_path());
            write_shard(&survey, &options, place, &origin, checkpoint, terminal)
        });
    }
    let shards = arguments.join.as_deref();
    let shards = shards
        .map(|folder| read_shards(folder, &origin))
        .transpose()?;
    let result = arguments.out.join("refine");
    let (report, json, files) = arguments.resume.run(&result, &origin, say, |checkpoint| {
        // After the check that the run to be continued is of the same frames.
        let overlay = leave_out_overlay(&mut survey, terminal)?;
        let (refined, json, mut outputs) = stage_refined(
            &survey,
            &overlay,
            &options,
            &arguments.out,
            record,
            (shards, Some(checkpoint)),
            terminal,
        )?;
        record.add_to(&mut outputs, &arguments.out.join(RUN_FILE), &inputs)?;
        let files = outputs.file_names();
        if arguments.follow.follow {
            for name in PREVIEW_FILES {
                outputs.remove(&arguments.out.join(name))?;
            }
        }
        outputs.commit()?;
        Ok((refined.report, json, files))
    })?;
    if terminal.is_json() {
        json::print_text(&json)?;
    } else {
        print_summary(&report, arguments.verbose, terminal);
        if arguments.joint && !report.levels.iter().any(|level| level.joint) {
            terminal.say(
                "  refined without --joint: the wall is smooth, so it has no detail below a pixel \
                 to estimate",
            );
        }
        print_outputs(&report, &arguments.out, &files, terminal);
    }
    conclude(arguments, &report, terminal)
}

/// The work of a refinement, which is checked as far as is possible without frames.
///
/// # Errors
/// Poses, options or measured points that cannot be refined.
fn describe(
    survey: &Survey,
    options: &RefineOptions,
    arguments: &RefineArguments,
) -> Result<Job, Failure> {
    let points = WallPoints::of_survey(survey)?;
    let input = RefineInput {
        points: points.as_ref(),
        ..RefineInput::from(survey)
    };
    check_input(input, options)?;
    let path = |name: &&str| arguments.out.join(name);
    let (writes, may_write) = match arguments.shard {
        Some(shard) => (vec![shard.file(&arguments.out)], Vec::new()),
        None => (
            REFINED_FILES.iter().map(path).collect(),
            FOUND_FILES.iter().map(path).collect(),
        ),
    };
    let share = arguments.share_of_work(survey);
    Ok(Job {
        writes,
        may_write,
        memory_bytes: Some(arguments.memory_bytes(survey)),
        time_s: Some(share * refine_s(survey, options)),
        ..Job::of(survey, None)
    })
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
    /// Memory of the run, bytes.
    fn memory_bytes(&self, survey: &Survey) -> u64 {
        let threads = rayon::current_num_threads();
        match (self.shard, &self.join) {
            (Some(ShardNumber { of, .. }), _) => shard_bytes(survey, of, threads),
            (None, Some(_)) => join_bytes(survey, threads),
            (None, None) => refine_bytes(survey, threads),
        }
    }

    /// Processor time of the run over that of a whole refinement.
    fn share_of_work(&self, survey: &Survey) -> f64 {
        match (self.shard, &self.join) {
            (Some(ShardNumber { of, .. }), _) => shard_share(survey, of),
            (None, Some(_)) => JOIN_SHARE,
            (None, None) => 1.0,
        }
    }

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
