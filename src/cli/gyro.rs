//! `tunnelstitch gyro`: initial poses from a gyro's log.

use super::carrier::{MountingArguments, WayArguments, numbers};
use super::frame_times::FrameTimesArguments;
use super::record::{self, Run};
use super::stitch::{parent_folder, positive};
use super::suggestion::{Suggestion, SuggestionArguments};
use super::{Failure, Terminal};
use crate::persist::atomic;
use crate::survey::PriorSection;
use crate::trajectory::gyro::{
    ClockOffset, FrameStations, GyroBaseline, GyroLog, GyroOptions, InitialAttitude, Orientation,
    ReadoutDirection, StationaryChoice, baseline_from_gyro,
};
use crate::trajectory::{JitterModel, Rate, read_camera_in_body, tum};
use nalgebra::{Matrix3, Vector3};
use std::path::PathBuf;

/// Writes initial poses (TUM) whose rotations are integrated from a gyro's log (gcsv, to which
/// Gyroflow converts those of most cameras), and whose places are the carrier's plan.
///
/// The bias is the mean rate where the sensor rested, which is found by itself; so is the noise
/// density, from which the prior for survey.toml follows.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    tunnelstitch gyro video.gcsv --survey survey --fps 25 --advance-m-per-s 0.2 --out survey/baseline.tum\n  \
    tunnelstitch gyro video.gcsv --survey survey --frame-times times.txt --table plan.csv --match-plan-s -10,10 --out survey/baseline.tum\n      \
    the clocks brought together by the plan's turns\n  \
    tunnelstitch gyro video.gcsv --frames 120 --fps 25 --rest-span-s 0,3 --down-deg 180 --out baseline.tum\n      \
    the first angle by gravity, with the tunnel's bottom at θ = 180°"
)]
pub struct GyroArguments {
    /// The log: Gyroflow's gcsv.
    log: PathBuf,
    /// Folder of the survey, or its survey.toml: whose frames the poses are for. Poses need not be
    /// there yet.
    #[arg(long, value_name = "SURVEY")]
    survey: Option<PathBuf>,
    /// The file of poses.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    times: FrameTimesArguments,
    /// The log's time minus the frames', seconds. A frame's time is that of its middle row.
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    time_offset_s: f64,
    /// Find it within this range instead, by the turns of the plan in --table.
    #[arg(
        long,
        value_name = "FROM,TO",
        value_parser = numbers::<2>,
        allow_hyphen_values = true,
        requires = "table",
        conflicts_with = "time_offset_s"
    )]
    match_plan_s: Option<[f64; 2]>,
    #[command(flatten)]
    suggestion: SuggestionArguments,
    #[command(flatten)]
    sensor: SensorArguments,
    #[command(flatten)]
    way: WayArguments,
    /// θ of the tunnel's bottom, degrees: the first angle is then told by gravity where the sensor
    /// rested, rather than by --start-angle-deg or the table.
    #[arg(
        long,
        value_name = "DEG",
        conflicts_with = "start_angle_deg",
        help_heading = "Carrier"
    )]
    down_deg: Option<f64>,
    /// How far the carrier turned about the axis from the first frame to the last, degrees, if
    /// known: the bias about the axis is changed so that it did.
    #[arg(long, value_name = "DEG", help_heading = "Carrier")]
    total_turn_deg: Option<f64>,
    /// 1-σ of each step along x, y and z, metres: how well the carrier keeps to its way.
    #[arg(long, value_name = "X,Y,Z", default_value = "0.02,0.02,0.03", value_parser = numbers::<3>)]
    translation_sigma_m: [f64; 3],
    #[command(flatten)]
    mounting: MountingArguments,
}

/// The sensor.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Sensor")]
struct SensorArguments {
    /// How the sensor sits in the camera, as Gyroflow's IMU orientation: three letters as YxZ
    /// [default: as the log says].
    #[arg(long, value_name = "XYZ", conflicts_with = "body_to_camera")]
    orientation: Option<String>,
    /// The motion from the sensor's axes, as the log has them, to the camera's instead: a 4 × 4
    /// matrix, EuRoC's sensor.yaml (T_BS), or a camchain of Kalibr (T_cam_imu).
    #[arg(long, value_name = "FILE")]
    body_to_camera: Option<PathBuf>,
    /// How long the sensor rested at some time, seconds.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = positive)]
    rest_s: f64,
    /// When it rested, seconds of the log's clock.
    #[arg(long, value_name = "FROM,TO", value_parser = numbers::<2>, allow_hyphen_values = true, conflicts_with = "rest_s")]
    rest_span_s: Option<[f64; 2]>,
    /// The bias about the camera's x (right), y (down) and z (forward), degrees a second, instead
    /// of the mean rate at rest.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    bias_deg_per_s: Option<[f64; 3]>,
    /// The noise density as data sheets have it, thousandths of a degree a second per √Hz, instead
    /// of that at rest.
    #[arg(long, value_name = "MDPS/√HZ", value_parser = positive)]
    density_mdps_sqrt_hz: Option<f64>,
    /// 1-σ of the sensor's scale, per cent of the angle turned: 1 to 3 for most as they come, a
    /// tenth of it once calibrated.
    #[arg(long, value_name = "PERCENT", default_value_t = 1.0)]
    scale_sigma_percent: f64,
}

impl SensorArguments {
    /// From the log's axes to the camera's.
    fn to_camera(&self, log: &GyroLog, terminal: &Terminal) -> Result<Matrix3<f64>, Failure> {
        if let Some(path) = &self.body_to_camera {
            let camera_in_body = read_camera_in_body(path)?;
            return Ok(camera_in_body
                .r_wc
                .inverse()
                .to_rotation_matrix()
                .into_inner());
        }
        let orientation = match (&self.orientation, log.orientation) {
            (Some(word), _) => Orientation::parse(word)
                .map_err(|what| Failure::usage(format!("--orientation: {what}")))?,
            (None, Some(orientation)) => orientation,
            (None, None) => {
                return Err(Failure::input(format!(
                    "{}: does not say how the sensor sits in the camera; give --orientation (Gyroflow's IMU orientation) or \
                     --body-to-camera FILE",
                    log.path.display()
                )));
            }
        };
        if orientation.is_mirror() {
            terminal.warn(
                "the sensor's orientation is a mirror: its axes are taken for left-handed, each with its rate by the right-hand \
                 rule, as Gyroflow takes them",
            );
        }
        Ok(orientation.to_camera())
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the log, the frames, the plan or the output.
pub fn run(arguments: &GyroArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    let times = arguments.times.find(arguments.survey.as_deref())?;
    let sensor = &arguments.sensor;
    let stations = arguments.way.stations(Rate::PerFrame(0.0), &times)?;
    let frames = FrameStations {
        times_s: times.clock("a gyro's log")?,
        stations: &stations,
        mounting: arguments.mounting.mounting(),
    };
    if !(sensor.scale_sigma_percent >= 0.0 && sensor.scale_sigma_percent.is_finite()) {
        return Err(Failure::usage("--scale-sigma-percent must be 0 or more"));
    }
    let options = GyroOptions {
        rest: match sensor.rest_span_s {
            Some(span_s) => StationaryChoice::Given(span_s),
            None => StationaryChoice::Find(sensor.rest_s),
        },
        bias_rad_s: sensor
            .bias_deg_per_s
            .map(|b| Vector3::from(b).map(f64::to_radians)),
        density_rad_sqrt_s: sensor.density_mdps_sqrt_hz.map(|d| (1e-3 * d).to_radians()),
        scale_sigma: 0.01 * sensor.scale_sigma_percent,
        total_turn_rad: arguments.total_turn_deg.map(f64::to_radians),
        clock: match arguments.match_plan_s {
            Some(range_s) => ClockOffset::Match(range_s),
            None => ClockOffset::Given(arguments.time_offset_s),
        },
        start: match arguments.down_deg {
            Some(down_deg) => InitialAttitude::Gravity {
                down_rad: down_deg.to_radians(),
            },
            None => InitialAttitude::Station,
        },
    };
    let log = GyroLog::read(&arguments.log)?;
    let to_camera = sensor.to_camera(&log, terminal)?;
    let baseline = baseline_from_gyro(&log, &to_camera, &frames, &options)?;
    for warning in &baseline.warnings {
        terminal.warn(warning);
    }
    if !arguments.way.is_given() {
        terminal.warn("the carrier is taken to stay where it is; give its way by --advance-m, --advance-m-per-s or --table");
    }
    parent_folder(&arguments.out)?;
    atomic::write_text(&arguments.out, &tum::format(&baseline.trajectory))?;
    let inputs = arguments.times.files(arguments.survey.as_deref());
    let others = arguments
        .way
        .file()
        .into_iter()
        .chain(&sensor.body_to_camera);
    let inputs = inputs.iter().chain(others).chain([&arguments.log]);
    let inputs = record::files(inputs.map(AsRef::as_ref))?;
    run.write(&record::beside(&arguments.out), &inputs)?;
    describe(arguments, &log, &baseline, terminal);
    let prior = PriorSection {
        model: JitterModel::RandomWalk,
        rotation_sigma_deg: baseline.step_sigma_rad.to_degrees(),
        translation_sigma_m: arguments.translation_sigma_m,
    };
    let mut suggestion = Suggestion::new(&arguments.out, arguments.survey.as_deref(), prior);
    suggestion.remark(format!(
        "The rotation's prior: {:.2} mdeg/s/√Hz of noise, {:.3} mdeg/s of bias, {} % of the angle turned.",
        1e3 * baseline.noise.density_rad_sqrt_s.to_degrees(),
        1e3 * baseline.noise.bias_sigma_rad_s.to_degrees(),
        sensor.scale_sigma_percent
    ));
    match log
        .readout
        .map(|readout| (readout.direction, readout.time_ms))
    {
        Some((ReadoutDirection::TopToBottom, ms)) => {
            suggestion.remark(format!(
                "The log tells of a rolling shutter; under [camera]: readout_ms = {ms}"
            ));
        }
        Some((ReadoutDirection::BottomToTop, ms)) => {
            suggestion.remark(format!(
                "The log tells of a rolling shutter; under [camera]: readout_ms = {}",
                -ms
            ));
        }
        Some((ReadoutDirection::Sideways, _)) => terminal.warn(
            "the log tells of a shutter that goes sideways, for which there is no remedy here",
        ),
        None => {}
    }
    suggestion.show(&arguments.suggestion, terminal)
}

/// Says what was found.
fn describe(
    arguments: &GyroArguments,
    log: &GyroLog,
    baseline: &GyroBaseline,
    terminal: &Terminal,
) {
    let first = log.samples.first().map_or(0.0, |sample| sample.time_s);
    let last = log.samples.last().map_or(0.0, |sample| sample.time_s);
    terminal.say(format!(
        "{} samples from {first:.3} to {last:.3} s, {:.1} a second",
        log.samples.len(),
        (log.samples.len() - 1) as f64 / (last - first)
    ));
    if let Some(rest) = &baseline.rest {
        terminal.say(format!(
            "at rest from {:.3} to {:.3} s",
            rest.span_s[0], rest.span_s[1]
        ));
    }
    let bias = baseline.bias_rad_s.map(f64::to_degrees);
    terminal.say(format!(
        "bias {:.4}, {:.4}, {:.4}°/s about the camera's x, y, z",
        bias.x, bias.y, bias.z
    ));
    let found = baseline.clock.map_or(String::new(), |clock| {
        format!(", found with a correlation of {:.4}", clock.correlation)
    });
    terminal.say(format!("time offset {:.4} s{found}", baseline.offset_s));
    terminal.say(format!(
        "turned by {:.2}° about the axis; each step is right to {:.4}°",
        baseline.turned_rad.to_degrees(),
        baseline.step_sigma_rad.to_degrees()
    ));
    terminal.say(format!(
        "wrote {} poses to {}",
        baseline.trajectory.len(),
        arguments.out.display()
    ));
}
