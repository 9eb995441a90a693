//! `tunnelstitch plan`: initial poses from what the carrier was told to do.

use super::carrier::{MountingArguments, WayArguments, numbers};
use super::frame_times::FrameTimesArguments;
use super::record::{self, Run};
use super::stitch::{parent_folder, positive};
use super::suggestion::{Suggestion, SuggestionArguments};
use super::{Failure, Terminal};
use crate::persist::atomic;
use crate::survey::PriorSection;
use crate::trajectory::{Rate, StampedPose, Trajectory, tum};
use std::path::PathBuf;

/// Writes initial poses (TUM) from the carrier's plan: an even advance and turn, or a table.
///
/// The tunnel's axis is the world's y. At angle 0 and without tilt or roll the camera looks along
/// z, its right towards larger θ, its lower edge ahead.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    tunnelstitch plan survey --advance-m 0.1 --turn-deg 30 --out survey/baseline.tum\n  \
    tunnelstitch plan survey --fps 25 --advance-m-per-s 0.2 --turn-deg-per-s 90 --out survey/baseline.tum\n  \
    tunnelstitch plan survey --table plan.csv --arm-m 0.3 --roll-deg 90 --out survey/baseline.tum\n  \
    tunnelstitch plan --frames 120 --advance-m 0.1 --turn-deg 30 --out baseline.tum"
)]
pub struct PlanArguments {
    /// Folder of the survey, or its survey.toml: whose frames the plan is for. Poses need not be
    /// there yet.
    survey: Option<PathBuf>,
    /// The file of poses.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    times: FrameTimesArguments,
    /// 1-σ of each step's rotation about each axis, degrees: how well the carrier keeps to the
    /// plan.
    #[arg(long, value_name = "DEG", default_value_t = PriorSection::default().rotation_sigma_deg, value_parser = positive)]
    rotation_sigma_deg: f64,
    /// 1-σ of each step along x, y and z, metres.
    #[arg(long, value_name = "X,Y,Z", default_value = "0.02,0.02,0.03", value_parser = numbers::<3>)]
    translation_sigma_m: [f64; 3],
    #[command(flatten)]
    suggestion: SuggestionArguments,
    #[command(flatten)]
    way: WayArguments,
    /// Turn about the axis from frame to frame, degrees; positive towards larger θ [default: 0].
    #[arg(long, value_name = "DEG", conflicts_with_all = ["turn_deg_per_s", "table"], help_heading = "Carrier")]
    turn_deg: Option<f64>,
    /// Turn about the axis each second, degrees.
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
pub fn run(arguments: &PlanArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    let frames = arguments.times.find(arguments.survey.as_deref())?;
    let turn_rad = match arguments.turn_deg_per_s {
        Some(rate) => {
            frames.clock("--turn-deg-per-s")?;
            Rate::PerSecond(rate.to_radians())
        }
        None => Rate::PerFrame(arguments.turn_deg.unwrap_or_default().to_radians()),
    };
    let turns = arguments.turn_deg.is_some() || arguments.turn_deg_per_s.is_some();
    if !turns && !arguments.way.is_given() {
        return Err(Failure::usage(
            "what is the plan? give --advance-m and --turn-deg, or the same by the second, or --table CSV",
        ));
    }
    let stations = arguments.way.stations(turn_rad, &frames)?;
    let camera = arguments.mounting.mounting().camera_in_carrier();
    let poses = stations.iter().zip(&frames.times_s);
    let trajectory: Trajectory = poses
        .map(|(station, time_s)| StampedPose {
            time_s: *time_s,
            pose: station.carrier().after(&camera),
        })
        .collect();
    parent_folder(&arguments.out)?;
    atomic::write_text(&arguments.out, &tum::format(&trajectory))?;
    let inputs = arguments.times.files(arguments.survey.as_deref());
    let inputs = record::files(inputs.iter().chain(arguments.way.file()).map(AsRef::as_ref))?;
    run.write(&record::beside(&arguments.out), &inputs)?;
    if let (Some(first), Some(last)) = (stations.first(), stations.last()) {
        terminal.say(format!(
            "wrote {} poses to {}: chainage {:.3} to {:.3} m, angle {:.2} to {:.2}°",
            trajectory.len(),
            arguments.out.display(),
            first.chainage_m,
            last.chainage_m,
            first.angle_rad.to_degrees(),
            last.angle_rad.to_degrees()
        ));
    }
    let prior = PriorSection {
        rotation_sigma_deg: arguments.rotation_sigma_deg,
        translation_sigma_m: arguments.translation_sigma_m,
        ..PriorSection::default()
    };
    let mut suggestion = Suggestion::new(&arguments.out, arguments.survey.as_deref(), prior);
    suggestion.remark("The prior is how well the carrier keeps to the plan from frame to frame:");
    suggestion
        .remark("put what yours does, or give --rotation-sigma-deg and --translation-sigma-m.");
    suggestion.show(&arguments.suggestion, terminal)
}
