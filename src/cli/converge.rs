//! `tunnelstitch converge`: how much noise the refinement can take.

use super::record::{RUN_FILE, Run};
use super::simulate::{JitterArgument, WallArgument, size};
use super::{Failure, Terminal, json};
use crate::evaluate::converge::{self, ConvergeOptions, SweepWall, TranslationScale};
use crate::trajectory::JitterModel;
use std::path::PathBuf;

/// Tests on simulated surveys how much noise of the poses the refinement can take.
///
/// Sweeps a grid of rotation and translation sigmas, noise models, walls and turns. Each run
/// simulates a survey (the `free` experiment with that noise), refines it with default options, and
/// measures every frame's error on the wall against the true poses, relative to the majority of the
/// frames. A run is a success if every frame is off by less than 0.5 px. A frame that `refine`
/// calls photometric and that is not as good is a false success. A survey whose true poses leave
/// the tunnel or look along it is drawn again with the next seed (seed + 1000, …).
///
/// Writes runs.jsonl (a line for each run as it finishes), converge.json and converge.txt (the runs
/// of each cell of the grid in numbers) and converge.png (the success rates as a map). Stop it with
/// Ctrl-C and call it again: runs that are in runs.jsonl are not done again, so more seeds or more
/// values extend a sweep.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch converge --out sweep\n      \
    the whole sweep: 5 rotation sigmas, both noise models, 20 seeds\n  \
    tunnelstitch converge --rotation-deg 2,6 --seeds 3 --frames 12 --size 320x240 --out quick\n      \
    a first look; call it again with --seeds 10 for 7 more runs of each cell\n  \
    tunnelstitch converge --rotation-deg 2,4,8 --translation-scale 0.5,1,2,4 --jitter random-walk --out grid\n      \
    rotation against translation; ×1 is 2, 2 and 3 cm\n  \
    tunnelstitch converge --turn-deg 20,30,45 --wall brick,concrete,tiled-brick --rotation-deg 4 --out walls\n      \
    overlap against texture\n  \
    tunnelstitch converge --efficiency --wall brick,concrete --frames 60 --seeds 10 --out limit\n      \
    how close the poses come to the Cramér–Rao bound, and whether their stated uncertainty is true")]
pub struct ConvergeArguments {
    /// Compare the errors with the Cramér–Rao bound (with the wall's texture known, and unknown but
    /// for its spectrum, which no estimator can do better than that knows no more) and with the
    /// stated covariances instead, at 2° of random walk if nothing else is asked for; writes
    /// efficiency.json and efficiency.txt.
    #[arg(long)]
    efficiency: bool,
    /// With --efficiency: refine as `refine --joint` does.
    #[arg(long, requires = "efficiency")]
    joint: bool,
    /// Folder for the results; made if missing. An unfinished sweep in it is continued.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// 1-σ of the rotation noise about each axis, degrees; a list.
    #[arg(
        long,
        value_name = "DEG,…",
        value_delimiter = ',',
        default_value_if("efficiency", "true", "2"),
        default_value = "2,4,6,8,12"
    )]
    rotation_deg: Vec<f64>,
    /// 1-σ of the translation noise: `auto` is (2, 2, 3) cm at 2° and in proportion to the
    /// rotation; a list is multiples of (2, 2, 3) cm, each with every rotation.
    #[arg(long, value_name = "auto|X,…", default_value = "auto", value_parser = translation_scale)]
    translation_scale: TranslationScale,
    /// Noise models: errors that add up from frame to frame, or each frame on its own; a list.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value_if("efficiency", "true", "random-walk"),
        default_value = "random-walk,independent"
    )]
    jitter: Vec<JitterArgument>,
    /// Turn from frame to frame, degrees; a list. A frame is 75° wide, so less turn is more
    /// overlap.
    #[arg(
        long,
        value_name = "DEG,…",
        value_delimiter = ',',
        default_value = "30",
        allow_hyphen_values = true
    )]
    turn_deg: Vec<f64>,
    /// What the wall looks like; a list.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "brick")]
    wall: Vec<WallArgument>,
    /// Runs of each cell: seeds 1 to N.
    #[arg(long, value_name = "N", default_value_t = ConvergeOptions::default().seeds, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Frames of each survey.
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u32).range(2..))]
    frames: u32,
    /// Width and height of the frames, pixels.
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size)]
    size: [u32; 2],
    /// 1-σ of the sensor's noise, grey levels.
    #[arg(long, value_name = "GREY", default_value_t = ConvergeOptions::default().noise_grey)]
    noise: f64,
    /// Drop the runs that are in DIR and begin afresh: for other --frames, --size or --noise, and
    /// after a change of the program.
    #[arg(long)]
    force: bool,
    /// Print converge.json on standard output instead of the table.
    #[arg(long)]
    json: bool,
}

fn translation_scale(text: &str) -> Result<TranslationScale, String> {
    if text.trim() == "auto" {
        return Ok(TranslationScale::Auto);
    }
    let factors: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    factors
        .map(TranslationScale::Factors)
        .map_err(|_| "must be auto, or numbers with commas between, as 0.5,1,2".to_owned())
}

impl ConvergeArguments {
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
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Impossible options, a log of another sweep, or an output that cannot be written.
pub fn run(arguments: &ConvergeArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    if arguments.efficiency {
        let table = converge::measure_efficiency(
            &arguments.options(),
            arguments.joint,
            &arguments.out,
            terminal,
        )?;
        run.write(&arguments.out.join(RUN_FILE), &[])?;
        if arguments.json {
            return json::print(&table);
        }
        for row in &table {
            terminal.say(format!("{row}\n"));
        }
        terminal.say(format!(
            "wrote {}",
            arguments.out.join("efficiency.json").display()
        ));
        return Ok(());
    }
    let swept = converge::run_sweep(
        &arguments.options(),
        &arguments.out,
        arguments.force,
        terminal,
    )?;
    run.write(&arguments.out.join(RUN_FILE), &[])?;
    if arguments.json {
        return json::print_text(&swept.json);
    }
    terminal.say(swept.result.to_string());
    let kept = match swept.kept {
        0 => String::new(),
        kept => format!(", {kept} found in runs.jsonl"),
    };
    terminal.say(format!(
        "wrote {} ({} runs done{kept})",
        arguments.out.display(),
        swept.done
    ));
    Ok(())
}
