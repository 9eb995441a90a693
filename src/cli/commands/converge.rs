//! `tunnelstitch converge`: measures the basin of convergence on simulated surveys.

use crate::cli::arguments::{
    DeformationArguments, JitterArgument, WallArgument, output_folder, picture_size,
};
use crate::cli::output::{DryRunArguments, Failure, Job, RUN_FILE, RunRecord, Terminal, json};
use crate::evaluate::converge::{self, ConvergeOptions, SweepWall, TranslationScale};
use crate::files::printed;
use crate::trajectory::JitterModel;
use std::path::PathBuf;

/// Measures on simulated surveys up to which pose errors the refinement converges.
///
/// Sweeps a grid of rotation and translation sigmas, noise models, walls and turns. Each run
/// simulates a survey (the `free` experiment with this noise), refines it with default options, and
/// measures the error of every frame on the wall against the true poses, relative to the majority
/// of the frames. A run succeeds if the error of every frame is below 0.5 px. A frame that `refine`
/// flags as photometric although its error is larger, and larger than 3.5 of its stated σ, counts
/// as a false success. A survey whose true poses leave the tunnel or look along it is simulated
/// again with the next seed (seed + 1000, …).
///
/// Writes runs.jsonl (a line for each finished run), converge.json and converge.txt (statistics of
/// each cell of the grid) and converge.png (map of the success rates). After Ctrl-C the same
/// command continues: runs in runs.jsonl are not repeated, so more seeds or more values extend a
/// sweep.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch converge --out sweep\n      \
    the whole sweep: 5 rotation sigmas, both noise models, 20 seeds\n  \
    tunnelstitch converge --rotation-deg 2,6 --seeds 3 --frames 12 --size 320x240 \
    --out quick\n      \
    a quick test; call it again with --seeds 10 for 7 more runs of each cell\n  \
    tunnelstitch converge --rotation-deg 2,4,8 --translation-scale 0.5,1,2,4 \
    --jitter random-walk --out grid\n      \
    rotation against translation; ×1 is 2, 2 and 3 cm\n  \
    tunnelstitch converge --turn-deg 20,30,45 --wall brick,concrete,tiled-brick \
    --rotation-deg 4 --out walls\n      \
    overlap against texture\n  \
    tunnelstitch converge --efficiency --wall brick,concrete --frames 60 --seeds 10 \
    --out limit\n      \
    efficiency against the Cramér–Rao bound, and consistency of the stated uncertainty\n  \
    tunnelstitch converge --efficiency --ovality-mm 5 --undulation-mm 3 --frames 48 --size 320x240 \
    --seeds 20 --out walls\n      \
    the same where the wall is deformed and unknown, and of its deformation")]
pub struct ConvergeArguments {
    /// Compare the errors with the Cramér–Rao bound and with the stated covariances instead. The
    /// bound is computed for a known wall texture, and for an unknown one of known spectrum; with a
    /// deformed wall, for a wall whose deformation is unknown, whose errors are compared, too.
    /// Defaults: random walk of 2°. Writes efficiency.json and efficiency.txt.
    #[arg(long)]
    efficiency: bool,
    /// With --efficiency: estimate the wall jointly, as `refine --joint` does.
    #[arg(long, requires = "efficiency")]
    joint: bool,
    /// Folder for the results; created if missing. An unfinished sweep in it is continued.
    #[arg(long, short, value_name = "DIR", value_parser = output_folder())]
    out: PathBuf,
    /// 1-σ of the rotation errors about each axis, degrees; a list.
    #[arg(
        long,
        value_name = "DEG,…",
        value_delimiter = ',',
        default_value_if("efficiency", "true", "2"),
        default_value = "2,4,6,8,12"
    )]
    rotation_deg: Vec<f64>,
    /// 1-σ of the translation errors: `auto` is (2, 2, 3) cm at 2°, proportional to the rotation; a
    /// list holds factors of (2, 2, 3) cm, each combined with every rotation.
    #[arg(long, value_name = "auto|X,…", default_value = "auto", value_parser = translation_scale)]
    translation_scale: TranslationScale,
    /// Noise models: errors that accumulate from frame to frame, or independent ones; a list.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value_if("efficiency", "true", "random-walk"),
        default_value = "random-walk,independent"
    )]
    jitter: Vec<JitterArgument>,
    /// Turn about the axis per frame, degrees; a list. A frame is 75° wide, so a smaller turn gives
    /// more overlap.
    #[arg(
        long,
        value_name = "DEG,…",
        value_delimiter = ',',
        default_value = "30",
        allow_hyphen_values = true
    )]
    turn_deg: Vec<f64>,
    /// Textures of the wall; a list.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "brick")]
    wall: Vec<WallArgument>,
    /// Runs per cell: seeds 1 to N.
    #[arg(
        long,
        value_name = "N",
        default_value_t = ConvergeOptions::default().seeds,
        value_parser = clap::value_parser!(u64).range(1..=1000)
    )]
    seeds: u64,
    /// Number of frames of each survey.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 24,
        value_parser = clap::value_parser!(u32).range(2..)
    )]
    frames: u32,
    /// Width and height of the frames, pixels.
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = picture_size)]
    size: [u32; 2],
    /// 1-σ of the sensor's noise, grey levels.
    #[arg(long, value_name = "GREY", default_value_t = ConvergeOptions::default().noise_grey)]
    noise: f64,
    #[command(flatten)]
    deformation: DeformationArguments,
    /// Delete the runs in DIR and start from the beginning: needed for other --frames, --size,
    /// --noise or deformations, and for another version of the program.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

fn translation_scale(text: &str) -> Result<TranslationScale, String> {
    if text.trim() == "auto" {
        return Ok(TranslationScale::Auto);
    }
    let factors: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    factors
        .map(TranslationScale::Factors)
        .map_err(|_| "must be auto, or numbers separated by commas, as 0.5,1,2".to_owned())
}

impl ConvergeArguments {
    /// Options for the library.
    fn options(&self) -> ConvergeOptions {
        ConvergeOptions {
            rotations_deg: self.rotation_deg.clone(),
            translation: self.translation_scale.clone(),
            jitters: self.jitter.iter().map(|j| JitterModel::from(*j)).collect(),
            turns_deg: self.turn_deg.clone(),
            walls: self
                .wall
                .iter()
                .map(|wall| match wall {
                    WallArgument::Brick => SweepWall::Brick,
                    WallArgument::Concrete => SweepWall::Concrete,
                    WallArgument::TiledBrick => SweepWall::TiledBrick,
                    WallArgument::Target => SweepWall::Target,
                })
                .collect(),
            seeds: self.seeds,
            frames: self.frames as usize,
            width: self.size[0],
            height: self.size[1],
            noise_grey: self.noise,
            deformation: self.deformation.deformation(),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Impossible options, a log of another sweep, or an output that cannot be written.
pub fn run(
    arguments: &ConvergeArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    if arguments.dry_run.is_set() {
        return describe(arguments)?.print(terminal);
    }
    if arguments.efficiency {
        return run_efficiency(arguments, record, terminal);
    }
    let swept = converge::run_sweep(
        &arguments.options(),
        &arguments.out,
        arguments.force,
        terminal,
    )?;
    record.write(&arguments.out.join(RUN_FILE), &[])?;
    if terminal.is_json() {
        return json::print_text(&swept.json);
    }
    terminal.say(swept.result.to_string());
    let kept = match swept.kept {
        0 => String::new(),
        kept => format!(", {kept} found in runs.jsonl"),
    };
    terminal.say(format!(
        "wrote {} ({} runs done{kept})",
        printed(&arguments.out),
        swept.done
    ));
    Ok(())
}

/// The work, after the checks that come before the first run.
///
/// # Errors
/// Impossible options, a log of another sweep, a folder that cannot be written into.
fn describe(arguments: &ConvergeArguments) -> Result<Job, Failure> {
    let (options, out) = (arguments.options(), &arguments.out);
    let (names, amount): (&[&str], _) = if arguments.efficiency {
        let surveys = converge::plan_efficiency(&options, out)?;
        let amount = format!("{surveys} surveys to simulate and refine");
        (&["efficiency.json", "efficiency.txt", RUN_FILE], amount)
    } else {
        let plan = converge::plan_sweep(&options, out, arguments.force)?;
        let names = &[
            "runs.jsonl",
            "converge.json",
            "converge.txt",
            "converge.png",
            RUN_FILE,
        ];
        let (missing, kept) = (plan.missing, plan.kept);
        let amount = format!("{missing} runs to do, {kept} found in runs.jsonl");
        (names, amount)
    };
    Ok(Job {
        writes: names.iter().map(|name| out.join(name)).collect(),
        amount: Some(amount),
        ..Job::default()
    })
}

/// Measures the efficiency instead of the basin of convergence.
fn run_efficiency(
    arguments: &ConvergeArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let table = converge::measure_efficiency(
        &arguments.options(),
        arguments.joint,
        &arguments.out,
        terminal,
    )?;
    record.write(&arguments.out.join(RUN_FILE), &[])?;
    if terminal.is_json() {
        return json::print(&table);
    }
    for row in &table {
        terminal.say(format!("{row}\n"));
    }
    terminal.say(format!(
        "wrote {}",
        printed(&arguments.out.join("efficiency.json"))
    ));
    Ok(())
}
