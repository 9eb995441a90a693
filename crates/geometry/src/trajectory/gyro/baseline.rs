//! Integration of a gyroscope's log to one pose per frame.

use super::clock_offset::ClockMatch;
use super::clock_offset::Turned;
use super::gravity::{angle_from_gravity_rad, axis_in_camera};
use super::integration::IntegratedRotation;
use super::log::GyroLog;
use super::noise::RotationNoise;
use super::rate_unit::wrong_unit;
use super::rates::AngularRates;
use super::stationary::StationaryInterval;
use crate::numerics::median::upper_median;
use crate::trajectory::error::PoseError;
use crate::trajectory::plan::{Mounting, Station};
use crate::trajectory::pose::Pose;
use crate::trajectory::stamped_pose::{StampedPose, Trajectory};
use nalgebra::{Matrix3, Vector3};

/// Times, planned stations and camera mounting of the frames.
#[derive(Clone, Copy, Debug)]
pub struct FrameStations<'a> {
    /// Times of the frames, seconds, increasing.
    pub times_s: &'a [f64],
    /// Planned stations, one per frame.
    pub stations: &'a [Station],
    /// The mounting of the camera on the carrier.
    pub mounting: Mounting,
}

/// Selection of the interval at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StationaryChoice {
    /// Search for the best interval of this length, seconds.
    Find(f64),
    /// Begin and end, seconds of the log's clock.
    Given([f64; 2]),
}

/// The offset of the log's clock: its time minus the frames'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClockOffset {
    /// A known offset, seconds.
    Given(f64),
    /// The offset within this range, seconds, at which the rates correlate best with the stations'.
    Match([f64; 2]),
}

/// Source of the first attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InitialAttitude {
    /// The station of the first frame.
    Station,
    /// The direction of gravity while the sensor is at rest gives the angle about the axis; the
    /// carrier is assumed to lie along the tunnel at the first frame.
    Gravity {
        /// θ of the tunnel's bottom, radians.
        down_rad: f64,
    },
}

/// Options of the integration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroOptions {
    /// The interval at rest.
    pub rest: StationaryChoice,
    /// The bias in the camera's axes, rad/s, instead of the mean rate at rest; assumed exact.
    pub bias_rad_s: Option<Vector3<f64>>,
    /// The noise density, rad/√s, instead of that at rest.
    pub density_rad_sqrt_s: Option<f64>,
    /// 1-σ of the sensor's scale factor, relative.
    pub scale_sigma: f64,
    /// Known rotation about the axis from the first frame to the last, radians; the bias about the
    /// axis is corrected to match it.
    pub total_turn_rad: Option<f64>,
    /// The offset between the clocks.
    pub clock: ClockOffset,
    /// Source of the first attitude.
    pub start: InitialAttitude,
}

/// Poses and noise from a gyroscope's log.
#[derive(Clone, Debug)]
pub struct GyroBaseline {
    /// One pose per frame, with the rotation from the log and the position from the station.
    pub trajectory: Trajectory,
    /// The interval at rest, if one was given or found.
    pub rest: Option<StationaryInterval>,
    /// The subtracted bias, rad/s in the camera's axes.
    pub bias_rad_s: Vector3<f64>,
    /// The log's time minus the frames', seconds.
    pub offset_s: f64,
    /// The correlation at the offset, if it was estimated.
    pub clock: Option<ClockMatch>,
    /// The noise of the rotations.
    pub noise: RotationNoise,
    /// 1-σ about each axis of the median step from frame to frame, radians.
    pub step_sigma_rad: f64,
    /// Rotation about the carrier's axis from the first frame to the last, radians.
    pub turned_rad: f64,
    /// Warnings about suspicious data.
    pub warnings: Vec<String>,
}

/// A step of the log longer than this many median steps is a gap.
const MIN_GAP_STEPS: f64 = 5.0;

/// Integrates a log; `to_camera` maps its axes to the camera's.
///
/// # Errors
/// [`PoseError::File`] of the log: no interval at rest although bias, density or gravity are needed
/// from it; clocks that cannot be matched; frames that the log does not cover; no accelerations, or
/// gravity along the axis, although gravity is to give the angle.
pub fn baseline_from_gyro(
    log: &GyroLog,
    to_camera: &Matrix3<f64>,
    frames: &FrameStations,
    options: &GyroOptions,
) -> Result<GyroBaseline, PoseError> {
    let fail = |what: String| PoseError::file(&log.path, what);
    let rates = log.rates(to_camera);
    let found = match options.rest {
        StationaryChoice::Find(length_s) => StationaryInterval::find(&rates, length_s),
        StationaryChoice::Given(span_s) => StationaryInterval::of(&rates, span_s),
    };
    let rest = found.as_ref().ok().copied();
    let rested = |wanted: &str| {
        let clone = found.clone();
        clone.map_err(|what| fail(format!("{what}; so {wanted}")))
    };
    let mut bias = match options.bias_rad_s {
        Some(bias) => bias,
        None => {
            rested("give the bias, or another stretch (--bias-deg-per-s, --rest-s, --rest-span-s)")?
                .bias_rad_s
        }
    };
    let density_rad_sqrt_s = match options.density_rad_sqrt_s {
        Some(density) => density,
        None => rested("give the noise density (--density-mdps-sqrt-hz)")?.density_rad_sqrt_s,
    };
    let axis = axis_in_camera(&frames.mounting);
    let (offset_s, clock) = match options.clock {
        ClockOffset::Given(offset_s) => (offset_s, None),
        ClockOffset::Match(range_s) => {
            let angles: Vec<f64> = frames.stations.iter().map(|s| s.angle_rad).collect();
            let clock = ClockMatch::find(&rates, &axis, frames.times_s, &angles, range_s)
                .map_err(|what| fail(format!("{what} (--match-plan-s, --time-offset-s)")))?;
            (clock.offset_s, Some(clock))
        }
    };
    let times_s = covered(&rates, frames.times_s, offset_s).map_err(fail)?;
    let (Some(first_s), Some(last_s)) = (times_s.first().copied(), times_s.last().copied()) else {
        return Err(fail("there are no frames".to_owned()));
    };
    let turned_rad = |bias: &Vector3<f64>| {
        let rates = rates.without(bias);
        let turned = Turned::new(&rates, &axis);
        Some(turned.at(last_s)? - turned.at(first_s)?)
    };
    let measured_rad = turned_rad(&bias);
    let wrong_unit = measured_rad
        .zip(log.rate_scale)
        .and_then(|(measured_rad, scale)| {
            let planned_rad = options.total_turn_rad.unwrap_or(planned_turn_rad(frames));
            wrong_unit(measured_rad, planned_rad, scale)
        });
    if let (Some(total_rad), Some(measured_rad)) = (options.total_turn_rad, measured_rad)
        && last_s > first_s
    {
        bias += axis * ((measured_rad - total_rad) / (last_s - first_s));
    }
    let turning = IntegratedRotation::new(rates.without(&bias));
    let between = |from_s: f64, to_s: f64| {
        let turn = turning.between(from_s, to_s);
        turn.ok_or_else(|| fail(format!("it does not hold {from_s} s to {to_s} s")))
    };
    let mount = frames.mounting.camera_in_carrier();
    let attitude = |angle_rad: f64| {
        let station = Station {
            angle_rad,
            ..Station::default()
        };
        station.carrier().r_wc * mount.r_wc
    };
    let start = match options.start {
        InitialAttitude::Station => attitude(frames.stations.first().map_or(0.0, |s| s.angle_rad)),
        InitialAttitude::Gravity { down_rad } => {
            let rest = rested("gravity gives no angle (--down-deg)")?;
            let up = to_camera * mean_acceleration(log, rest.span_s).map_err(fail)?;
            // Gravity in the first frame's camera coordinates: the carrier lies along the tunnel
            // there, but not necessarily while at rest.
            let middle_s = 0.5 * (rest.span_s[0] + rest.span_s[1]);
            let up = between(first_s, middle_s)? * up;
            let angle_rad =
                angle_from_gravity_rad(&up, &frames.mounting, down_rad).ok_or_else(|| {
                    fail(
                        "gravity is along the tunnel's axis and gives no angle (--down-deg)"
                            .to_owned(),
                    )
                })?;
            attitude(angle_rad)
        }
    };
    let mut trajectory = Trajectory::with_capacity(times_s.len());
    for ((at_s, time_s), station) in times_s.iter().zip(frames.times_s).zip(frames.stations) {
        let r_wc = start * between(first_s, *at_s)?;
        let carrier = r_wc * mount.r_wc.inverse();
        trajectory.push(StampedPose {
            time_s: *time_s,
            pose: Pose::new(r_wc, station.carrier().t_wc + carrier * mount.t_wc),
        });
    }
    let noise = RotationNoise {
        density_rad_sqrt_s,
        bias_sigma_rad_s: match (options.bias_rad_s, &rest) {
            (None, Some(rest)) => density_rad_sqrt_s / rest.length_s().sqrt(),
            _ => 0.0,
        },
        scale_sigma: options.scale_sigma,
    };
    Ok(GyroBaseline {
        step_sigma_rad: step_sigma_rad(&noise, &trajectory),
        turned_rad: turned_rad(&bias).unwrap_or(f64::NAN),
        warnings: gaps(&rates, [first_s, last_s])
            .into_iter()
            .chain(wrong_unit)
            .collect(),
        trajectory,
        rest,
        bias_rad_s: bias,
        offset_s,
        clock,
        noise,
    })
}

/// Turn of the plan from the first frame to the last, radians.
fn planned_turn_rad(frames: &FrameStations) -> f64 {
    match frames.stations {
        [first, .., last] => last.angle_rad - first.angle_rad,
        _ => 0.0,
    }
}

/// The frames' times on the log's clock; an error if the log does not cover all of them.
fn covered(rates: &AngularRates, times_s: &[f64], offset_s: f64) -> Result<Vec<f64>, String> {
    let [first_s, last_s] = rates.span_s();
    let at = |(frame, time_s): (usize, &f64)| {
        let at_s = time_s + offset_s;
        if (first_s..=last_s).contains(&at_s) {
            Ok(at_s)
        } else {
            Err(format!(
                "frame {frame} at {time_s} s is at {at_s:.3} s of the log, which goes from \
                 {first_s:.3} s to {last_s:.3} s; \
             give the log's time minus the frames' (--time-offset-s)"
            ))
        }
    };
    times_s.iter().enumerate().map(at).collect()
}

/// The mean acceleration in the sensor's axes over an interval, multiples of g.
fn mean_acceleration(log: &GyroLog, span_s: [f64; 2]) -> Result<Vector3<f64>, String> {
    let within = log
        .samples
        .iter()
        .filter(|sample| (span_s[0]..=span_s[1]).contains(&sample.time_s));
    let felt: Vec<Vector3<f64>> = within.filter_map(|sample| sample.acceleration_g).collect();
    match felt.len() {
        0 => Err("it has no accelerations, so gravity gives no angle (--down-deg)".to_owned()),
        count => Ok(felt.iter().sum::<Vector3<f64>>() / count as f64),
    }
}

/// The uncertainty of the median step in time and angle.
fn step_sigma_rad(noise: &RotationNoise, trajectory: &[StampedPose]) -> f64 {
    let median = |of: fn(&StampedPose, &StampedPose) -> f64| {
        let values = trajectory.windows(2).map(|p| of(&p[0], &p[1]));
        upper_median(values.collect()).unwrap_or(0.0)
    };
    noise.sigma_rad(
        median(|a, b| b.time_s - a.time_s),
        median(|a, b| a.pose.r_wc.angle_to(&b.pose.r_wc)),
    )
}

/// A warning about the longest step between samples during the frames, if it is a gap.
fn gaps(rates: &AngularRates, span_s: [f64; 2]) -> Option<String> {
    let median_s = rates.steps_s()[0];
    let steps = rates.times_s().windows(2).filter_map(|pair| match pair {
        [from, to] if *to >= span_s[0] && *from <= span_s[1] => Some((to - from, *from)),
        _ => None,
    });
    let (longest_s, at_s) = steps.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (longest_s > MIN_GAP_STEPS * median_s).then(|| {
        format!(
            "the log has a gap of {longest_s:.3} s after {at_s:.3} s, where it usually has a \
             sample each {median_s:.4} s; \
             the rate is taken to change evenly there"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::gyro::log::GyroSample;
    use crate::trajectory::so3;

    /// A sensor without noise, with a bias of 0.01 rad/s about every axis: three seconds at rest,
    /// then 0.5 rad/s about y.
    fn log(gap: bool, accelerations: bool) -> GyroLog {
        let in_gap = |t: f64| gap && t > 5.0 && t < 5.5;
        let times = (0..1600).map(|k| f64::from(k) / 200.0);
        let sample = |time_s: f64| GyroSample {
            time_s,
            rate_rad_s: Vector3::from_element(0.01)
                + Vector3::y() * if time_s < 3.0 { 0.0 } else { 0.5 },
            acceleration_g: accelerations.then(Vector3::y),
        };
        GyroLog {
            path: "log.gcsv".into(),
            orientation: None,
            readout: None,
            rate_scale: Some(1.0),
            samples: times.filter(|t| !in_gap(*t)).map(sample).collect(),
        }
    }

    const OPTIONS: GyroOptions = GyroOptions {
        rest: StationaryChoice::Find(2.0),
        bias_rad_s: None,
        density_rad_sqrt_s: None,
        scale_sigma: 0.0,
        total_turn_rad: None,
        clock: ClockOffset::Given(3.5),
        start: InitialAttitude::Station,
    };

    fn baseline(log: &GyroLog, options: &GyroOptions) -> Result<GyroBaseline, PoseError> {
        let times_s: Vec<f64> = (0..5).map(f64::from).collect();
        let station = |t: &f64| Station {
            chainage_m: *t,
            angle_rad: 1.0,
            offset_m: [0.1, 0.0],
        };
        let stations: Vec<Station> = times_s.iter().map(station).collect();
        let frames = FrameStations {
            times_s: &times_s,
            stations: &stations,
            mounting: Mounting {
                arm_m: 0.2,
                ..Mounting::default()
            },
        };
        baseline_from_gyro(log, &Matrix3::identity(), &frames, options)
    }

    #[test]
    fn rotations_are_the_logs_and_places_the_stations() {
        let found = baseline(&log(false, true), &OPTIONS).unwrap();
        assert!((found.bias_rad_s - Vector3::from_element(0.01)).norm() < 1e-12);
        assert!((found.turned_rad - 2.0).abs() < 1e-9 && found.warnings.is_empty());
        let last = found.trajectory[4];
        assert_eq!(last.time_s, 4.0);
        let expected = so3::exp(&(Vector3::y() * 3.0));
        assert!(last.pose.r_wc.angle_to(&expected) < 1e-9);
        let place = Vector3::new(0.1 + 0.2 * 3f64.sin(), 4.0, 0.2 * 3f64.cos());
        assert!((last.pose.t_wc - place).norm() < 1e-9);
    }

    #[test]
    fn a_known_turn_puts_the_bias_about_the_axis_right() {
        let options = GyroOptions {
            bias_rad_s: Some(Vector3::zeros()),
            density_rad_sqrt_s: Some(1e-4),
            total_turn_rad: Some(2.0),
            ..OPTIONS
        };
        let found = baseline(&log(false, true), &options).unwrap();
        assert!((found.bias_rad_s - Vector3::y() * 0.01).norm() < 1e-9);
        assert_eq!(found.noise.bias_sigma_rad_s, 0.0);
        assert!((found.step_sigma_rad - 1e-4).abs() < 1e-12);
    }

    #[test]
    fn rates_in_another_unit_than_the_plan_are_warned_of() {
        let of = |total_deg: f64| {
            let options = GyroOptions {
                total_turn_rad: Some(total_deg.to_radians()),
                ..OPTIONS
            };
            baseline(&log(false, true), &options).unwrap().warnings
        };
        assert!(of(2f64.to_degrees()).is_empty());
        // The log turns by 2 rad, and 115 rad are known.
        let warnings = of(2f64.to_degrees().to_degrees());
        assert!(warnings[0].contains("gscale,5.729578e1"), "{warnings:?}");
    }

    #[test]
    fn gaps_are_reported() {
        let found = baseline(&log(true, true), &OPTIONS).unwrap();
        let warning = &found.warnings[0];
        assert!(
            warning.contains("gap of 0.500 s after 5.000 s"),
            "{warning}"
        );
    }

    #[test]
    fn what_gravity_cannot_tell_is_refused() {
        let options = GyroOptions {
            start: InitialAttitude::Gravity { down_rad: 0.0 },
            ..OPTIONS
        };
        for (accelerations, expected) in [
            (false, "no accelerations"),
            (true, "along the tunnel's axis"),
        ] {
            let error = baseline(&log(false, accelerations), &options).unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
        }
        let beyond = GyroOptions {
            clock: ClockOffset::Given(4.5),
            ..OPTIONS
        };
        let error = baseline(&log(false, true), &beyond)
            .unwrap_err()
            .to_string();
        assert!(error.contains("frame 4 at 4 s is at 8.500 s"), "{error}");
    }
}
