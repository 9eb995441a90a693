//! `tunnelstitch plan`: computes initial poses from the planned motion of the carrier.

use crate::cli::arguments::{
    FrameTimesArguments, MotionArguments, MountingArguments, clock_times, numbers, positive,
};
use crate::cli::output::{
    Failure, RunRecord, Suggestion, SuggestionArguments, Terminal, check_parent_folder, is_stream,
    json, record, refuse_two_results,
};
use crate::files::printed;
use crate::persist::atomic::OutputSet;
use crate::survey::PriorSection;
use crate::trajectory::{Rate, StampedPose, Trajectory, tum};
use std::path::PathBuf;

/// Writes initial poses (TUM) from the planned motion of the carrier: constant advance and turn, or
/// a table.
///
/// The tunnel's axis is the world's y. At angle 0, without tilt or roll, the camera looks along z;
/// the image's right points to larger θ, its lower edge ahead.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    tunnelstitch plan survey --advance-m 0.1 --turn-deg 30 --out survey/baseline.tum\n  \
    tunnelstitch plan survey --fps 25 --advance-m-per-s 0.2 --turn-deg-per-s 90 \
    --out survey/baseline.tum\n  \
    tunnelstitch plan survey --table plan.csv --arm-m 0.3 --roll-deg 90 \
    --out survey/baseline.tum\n  \
    tunnelstitch plan --frames 120 --advance-m 0.1 --turn-deg 30 --out baseline.tum"
)]
pub struct PlanArguments {
    /// Folder of the survey whose frames get the poses, or its survey.toml. Its own poses need not
    /// exist yet.
    survey: Option<PathBuf>,
    /// The file of poses to write; `-` prints them on standard output, without a record of the run.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    times: FrameTimesArguments,
    /// 1-σ of the rotation error of each step about each axis, degrees: how well the carrier
    /// follows the plan.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = PriorSection::default().rotation_sigma_deg,
        value_parser = positive
    )]
    rotation_sigma_deg: f64,
    /// 1-σ of the translation error of each step along x, y and z, metres.
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "0.02,0.02,0.03",
        value_parser = numbers::<3>
    )]
    translation_sigma_m: [f64; 3],
    #[command(flatten)]
    suggestion: SuggestionArguments,
    #[command(flatten)]
    motion: MotionArguments,
    /// Turn about the axis per frame, degrees; positive towards larger θ [default: 0].
    #[arg(
        long,
        value_name = "DEG",
        conflicts_with_all = ["turn_deg_per_s", "table"],
        help_heading = "Carrier"
    )]
    turn_deg: Option<f64>,
    /// Turn about the axis per second, degrees.
    #[arg(
        long,
        value_name = "DEG",
        conflicts_with = "table",
        help_heading = "Carrier"
    )]
    turn_deg_per_s: Option<f64>,
    #[command(flatten)]
    mounting: MountingArguments,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the plan, the frames or the output.
pub fn run(
    arguments: &PlanArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let frames = arguments.times.find(arguments.survey.as_deref())?;
    let turn_rad = match arguments.turn_deg_per_s {
        Some(rate) => {
            clock_times(&frames, "--turn-deg-per-s")?;
            Rate::PerSecond(rate.to_radians())
        }
        None => Rate::PerFrame(arguments.turn_deg.unwrap_or_default().to_radians()),
    };
    let turns = arguments.turn_deg.is_some() || arguments.turn_deg_per_s.is_some();
    if !turns && !arguments.motion.is_given() {
        return Err(Failure::usage(
            "no motion is given: give --advance-m and --turn-deg, or the same per second, or \
             --table CSV",
        ));
    }
    let stations = arguments.motion.stations(turn_rad, &frames)?;
    let camera = arguments.mounting.mounting().camera_in_carrier();
    let poses = stations.iter().zip(&frames.times_s);
    let trajectory: Trajectory = poses
        .map(|(station, time_s)| StampedPose {
            time_s: *time_s,
            pose: station.carrier().after(&camera),
        })
        .collect();
    let prior = PriorSection {
        rotation_sigma_deg: arguments.rotation_sigma_deg,
        translation_sigma_m: arguments.translation_sigma_m,
        ..PriorSection::default()
    };
    let mut suggestion = Suggestion::new(&arguments.out, arguments.survey.as_deref(), prior);
    suggestion
        .add_remark("The prior says how well the carrier follows the plan from frame to frame:");
    suggestion.add_remark(
        "adapt it to your carrier, or give --rotation-sigma-deg and --translation-sigma-m.",
    );
    if is_stream(&arguments.out) {
        refuse_two_results(&arguments.out, terminal)?;
        suggestion.write(&arguments.suggestion)?;
        return json::print_text(&tum::format(&trajectory));
    }
    check_parent_folder(&arguments.out)?;
    let mut outputs = OutputSet::default();
    outputs.write_text(&arguments.out, &tum::format(&trajectory))?;
    let inputs = arguments.times.files(arguments.survey.as_deref());
    let inputs = inputs.iter().chain(arguments.motion.file());
    let inputs = record::hash_files(inputs.map(AsRef::as_ref))?;
    record.add_to(&mut outputs, &record::path_beside(&arguments.out), &inputs)?;
    outputs.commit()?;
    if let (Some(first), Some(last)) = (stations.first(), stations.last()) {
        terminal.say(format!(
            "wrote {} poses to {}: chainage {:.3} to {:.3} m, angle {:.2} to {:.2}°",
            trajectory.len(),
            printed(&arguments.out),
            first.chainage_m,
            last.chainage_m,
            first.angle_rad.to_degrees(),
            last.angle_rad.to_degrees()
        ));
    }
    suggestion.show(&arguments.suggestion, terminal)?;
    terminal.result(&suggestion.report(&arguments.out, trajectory.len()))
}
