//! `tunnelstitch gyro`: computes initial poses from a gyroscope log.

use crate::cli::arguments::{
    FrameTimesArguments, MotionArguments, MountingArguments, clock_times, input_file, numbers,
    positive,
};
use crate::cli::output::{
    Failure, PosesReport, RunRecord, Suggestion, SuggestionArguments, Terminal,
    check_parent_folder, is_stream, json, record, refuse_two_results,
};
use crate::files::printed;
use crate::persist::atomic::OutputSet;
use crate::survey::PriorSection;
use crate::trajectory::gyro::{
    ClockOffset, FrameStations, GyroBaseline, GyroLog, GyroOptions, InitialAttitude, Orientation,
    ReadoutDirection, StationaryChoice, baseline_from_gyro,
};
use crate::trajectory::{JitterModel, Rate, read_camera_in_body, tum};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::path::PathBuf;

/// Writes initial poses (TUM): rotations integrated from a gyroscope log (the MP4 of a GoPro, or
/// gcsv, to which Gyroflow converts the logs of most cameras), positions from the planned motion of
/// the carrier.
///
/// Bias and noise density are estimated from an interval at rest, which is detected automatically.
/// The prior for survey.toml follows from them.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "Examples:\n  \
    tunnelstitch gyro video.gcsv --survey survey --fps 25 --advance-m-per-s 0.2 \
    --out survey/baseline.tum\n  \
    tunnelstitch gyro video.gcsv --survey survey --frame-times times.txt --table plan.csv \
    --match-plan-s -10,10 --out survey/baseline.tum\n      \
    synchronises the clocks by the turns of the plan\n  \
    tunnelstitch gyro video.gcsv --frames 120 --fps 25 --rest-span-s 0,3 --down-deg 180 \
    --out baseline.tum\n      \
    takes the first angle from gravity, with the tunnel's bottom at θ = 180°\n  \
    tunnelstitch gyro GX010001.MP4 --survey survey --fps 29.97 --advance-m-per-s 0.2 \
    --out survey/baseline.tum\n      \
    reads the gyro that a GoPro writes into its video"
)]
pub struct GyroArguments {
    /// The log: Gyroflow's gcsv, or a video as a GoPro wrote it (MP4 with its track `gpmd`); `-`
    /// is standard input.
    #[arg(value_parser = input_file())]
    log: PathBuf,
    /// Folder of the survey whose frames get the poses, or its survey.toml. Its own poses need not
    /// exist yet.
    #[arg(long, value_name = "SURVEY")]
    survey: Option<PathBuf>,
    /// The file of poses to write; `-` prints them on standard output, without a record of the run.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    times: FrameTimesArguments,
    /// Offset of the clocks: time of the log minus time of the frames, seconds. The time of a frame
    /// is that of its middle row.
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    time_offset_s: f64,
    /// Estimate the offset of the clocks within this range, seconds, from the turns of the plan in
    /// --table.
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
    motion: MotionArguments,
    /// θ of the tunnel's bottom, degrees: takes the first angle from gravity while the sensor
    /// rests, instead of from --start-angle-deg or the table.
    #[arg(
        long,
        value_name = "DEG",
        conflicts_with = "start_angle_deg",
        help_heading = "Carrier"
    )]
    down_deg: Option<f64>,
    /// Known turn of the carrier about the axis from the first to the last frame, degrees; corrects
    /// the bias about the axis.
    #[arg(long, value_name = "DEG", help_heading = "Carrier")]
    total_turn_deg: Option<f64>,
    /// 1-σ of the translation error of each step along x, y and z, metres: how well the carrier
    /// follows the plan.
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "0.02,0.02,0.03",
        value_parser = numbers::<3>
    )]
    translation_sigma_m: [f64; 3],
    #[command(flatten)]
    mounting: MountingArguments,
}

/// Calibration of the gyroscope.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Sensor")]
struct SensorArguments {
    /// Orientation of the sensor in the camera, as Gyroflow's IMU orientation: three letters, as
    /// YxZ [default: that of the log].
    #[arg(long, value_name = "XYZ", conflicts_with = "body_to_camera")]
    orientation: Option<String>,
    /// Extrinsics between the sensor's axes in the log and the camera, instead: a 4 × 4 matrix,
    /// EuRoC's sensor.yaml (T_BS), or a camchain of Kalibr (T_cam_imu).
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    body_to_camera: Option<PathBuf>,
    /// Length of the interval at rest to search for, seconds.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = positive)]
    rest_s: f64,
    /// The interval at rest, seconds of the log's clock.
    #[arg(
        long,
        value_name = "FROM,TO",
        value_parser = numbers::<2>,
        allow_hyphen_values = true,
        conflicts_with = "rest_s"
    )]
    rest_span_s: Option<[f64; 2]>,
    /// Bias about the camera's x (right), y (down) and z (forward), degrees per second
    /// [default: mean rate at rest].
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_parser = numbers::<3>,
        allow_hyphen_values = true
    )]
    bias_deg_per_s: Option<[f64; 3]>,
    /// Noise density as in data sheets, thousandths of a degree per second per √Hz
    /// [default: noise at rest].
    #[arg(long, value_name = "MDPS/√HZ", value_parser = positive)]
    density_mdps_sqrt_hz: Option<f64>,
    /// 1-σ of the sensor's scale factor, per cent of the angle turned: 1 to 3 for most
    /// uncalibrated sensors, a tenth of that after calibration.
    #[arg(long, value_name = "PERCENT", default_value_t = 1.0)]
    scale_sigma_percent: f64,
}

impl GyroArguments {
    /// Options for the library.
    ///
    /// # Errors
    /// A negative or infinite --scale-sigma-percent.
    fn options(&self) -> Result<GyroOptions, Failure> {
        let sensor = &self.sensor;
        if !(sensor.scale_sigma_percent >= 0.0 && sensor.scale_sigma_percent.is_finite()) {
            return Err(Failure::usage("--scale-sigma-percent must be 0 or more"));
        }
        Ok(GyroOptions {
            rest: match sensor.rest_span_s {
                Some(span_s) => StationaryChoice::Given(span_s),
                None => StationaryChoice::Find(sensor.rest_s),
            },
            bias_rad_s: sensor
                .bias_deg_per_s
                .map(|b| Vector3::from(b).map(f64::to_radians)),
            density_rad_sqrt_s: sensor.density_mdps_sqrt_hz.map(|d| (1e-3 * d).to_radians()),
            scale_sigma: 0.01 * sensor.scale_sigma_percent,
            total_turn_rad: self.total_turn_deg.map(f64::to_radians),
            clock: match self.match_plan_s {
                Some(range_s) => ClockOffset::Match(range_s),
                None => ClockOffset::Given(self.time_offset_s),
            },
            start: match self.down_deg {
                Some(down_deg) => InitialAttitude::Gravity {
                    down_rad: down_deg.to_radians(),
                },
                None => InitialAttitude::Station,
            },
        })
    }
}

impl SensorArguments {
    /// Rotation from the axes of the log to those of the camera.
    ///
    /// # Errors
    /// A malformed orientation or file; no orientation at all.
    fn rotation_to_camera(
        &self,
        log: &GyroLog,
        terminal: &Terminal,
    ) -> Result<Matrix3<f64>, Failure> {
        if let Some(path) = &self.body_to_camera {
            let camera_in_body = read_camera_in_body(path, None)?;
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
                    "{}: has no orientation of the sensor in the camera; give --orientation \
                     (Gyroflow's IMU orientation) or --body-to-camera FILE",
                    printed(&log.path)
                )));
            }
        };
        if orientation.is_mirror() {
            terminal.warn(
                "the sensor's orientation is a reflection: its axes are read as left-handed, each \
                 rate by the right-hand rule, as Gyroflow does",
            );
        }
        Ok(orientation.to_camera())
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the log, the frames, the plan or the output.
pub fn run(
    arguments: &GyroArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let times = arguments.times.find(arguments.survey.as_deref())?;
    let sensor = &arguments.sensor;
    let stations = arguments.motion.stations(Rate::PerFrame(0.0), &times)?;
    let frames = FrameStations {
        times_s: clock_times(&times, "a gyroscope log")?,
        stations: &stations,
        mounting: arguments.mounting.mounting(),
    };
    let options = arguments.options()?;
    let log = GyroLog::read(&arguments.log)?;
    let to_camera = sensor.rotation_to_camera(&log, terminal)?;
    let baseline = baseline_from_gyro(&log, &to_camera, &frames, &options)?;
    for warning in &baseline.warnings {
        terminal.warn(warning);
    }
    if !arguments.motion.is_given() {
        terminal.warn(
            "no motion is given, so the carrier is assumed to stay in place; give its motion by \
             --advance-m, --advance-m-per-s or --table",
        );
    }
    let (suggestion, readout_ms) = suggestion(arguments, &log, &baseline, terminal);
    if is_stream(&arguments.out) {
        refuse_two_results(&arguments.out, terminal)?;
        suggestion.write(&arguments.suggestion)?;
        return json::print_text(&tum::format(&baseline.trajectory));
    }
    check_parent_folder(&arguments.out)?;
    let mut outputs = OutputSet::default();
    outputs.write_text(&arguments.out, &tum::format(&baseline.trajectory))?;
    let inputs = arguments.times.files(arguments.survey.as_deref());
    let motion = arguments.motion.file();
    let others = motion.into_iter().chain(&sensor.body_to_camera);
    let inputs = inputs.iter().chain(others).chain([&arguments.log]);
    let inputs = record::hash_files(inputs.map(AsRef::as_ref))?;
    record.add_to(&mut outputs, &record::path_beside(&arguments.out), &inputs)?;
    outputs.commit()?;
    print_summary(arguments, &log, &baseline, terminal);
    suggestion.show(&arguments.suggestion, terminal)?;
    terminal.result(&GyroReport {
        poses: suggestion.report(&arguments.out, baseline.trajectory.len()),
        samples: log.samples.len(),
        rest_span_s: baseline.rest.as_ref().map(|rest| rest.span_s),
        bias_deg_per_s: baseline.bias_rad_s.map(f64::to_degrees).into(),
        time_offset_s: baseline.offset_s,
        clock_correlation: baseline.clock.map(|clock| clock.correlation),
        turned_deg: baseline.turned_rad.to_degrees(),
        step_sigma_deg: baseline.step_sigma_rad.to_degrees(),
        readout_ms,
    })
}

/// The prior and the rolling shutter for `survey.toml`; the readout time, milliseconds, if the log
/// states one along the rows.
fn suggestion(
    arguments: &GyroArguments,
    log: &GyroLog,
    baseline: &GyroBaseline,
    terminal: &Terminal,
) -> (Suggestion, Option<f64>) {
    let prior = PriorSection {
        model: JitterModel::RandomWalk,
        rotation_sigma_deg: baseline.step_sigma_rad.to_degrees(),
        translation_sigma_m: arguments.translation_sigma_m,
    };
    let mut suggestion = Suggestion::new(&arguments.out, arguments.survey.as_deref(), prior);
    suggestion.add_remark(format!(
        "Prior of the rotation: {:.2} mdeg/s/√Hz of noise, {:.3} mdeg/s of bias, {} % of the angle \
         turned.",
        1e3 * baseline.noise.density_rad_sqrt_s.to_degrees(),
        1e3 * baseline.noise.bias_sigma_rad_s.to_degrees(),
        arguments.sensor.scale_sigma_percent
    ));
    let readout_ms = log.readout.map(|readout| match readout.direction {
        ReadoutDirection::TopToBottom => Some(readout.time_ms),
        ReadoutDirection::BottomToTop => Some(-readout.time_ms),
        ReadoutDirection::Sideways => None,
    });
    match readout_ms {
        Some(Some(ms)) => suggestion.add_remark(format!(
            "The log states a rolling shutter; put under [camera]: readout_ms = {ms}"
        )),
        Some(None) => terminal
            .warn("the log states a rolling shutter that is read sideways, which is not supported"),
        None => {}
    }
    (suggestion, readout_ms.flatten())
}

/// The result, for `--json`.
#[derive(Serialize)]
struct GyroReport<'a> {
    #[serde(flatten)]
    poses: PosesReport<'a>,
    samples: usize,
    rest_span_s: Option<[f64; 2]>,
    bias_deg_per_s: [f64; 3],
    time_offset_s: f64,
    clock_correlation: Option<f64>,
    turned_deg: f64,
    step_sigma_deg: f64,
    /// As `camera.readout_ms` in survey.toml; null if the log states none, or one sideways.
    readout_ms: Option<f64>,
}

/// Prints rest, bias, clock and turn.
fn print_summary(
    arguments: &GyroArguments,
    log: &GyroLog,
    baseline: &GyroBaseline,
    terminal: &Terminal,
) {
    let first_s = log.samples.first().map_or(0.0, |sample| sample.time_s);
    let last_s = log.samples.last().map_or(0.0, |sample| sample.time_s);
    terminal.say(format!(
        "{} samples from {first_s:.3} to {last_s:.3} s, {:.1} per second",
        log.samples.len(),
        (log.samples.len() - 1) as f64 / (last_s - first_s)
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
    let correlation = baseline.clock.map_or(String::new(), |clock| {
        format!(", estimated with a correlation of {:.4}", clock.correlation)
    });
    terminal.say(format!(
        "time offset {:.4} s{correlation}",
        baseline.offset_s
    ));
    terminal.say(format!(
        "turn of {:.2}° about the axis; 1-σ of each step {:.4}°",
        baseline.turned_rad.to_degrees(),
        baseline.step_sigma_rad.to_degrees()
    ));
    terminal.say(format!(
        "wrote {} poses to {}",
        baseline.trajectory.len(),
        printed(&arguments.out)
    ));
}
