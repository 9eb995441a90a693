//! The log of a GoPro's gyro.

use super::sample_table::payloads;
use super::sensor::{Sensor, SensorKind};
use super::settings::readout_ms;
use super::video_file::VideoFile;
use crate::files::limits::MAX_TABLE_BYTES;
use crate::trajectory::error::PoseError;
use crate::trajectory::gyro::log::{GyroLog, GyroSample, Readout, ReadoutDirection};
use crate::trajectory::gyro::orientation::Orientation;
use nalgebra::Vector3;

/// Standard gravity, m/s².
const GRAVITY_M_S2: f64 = 9.806_65;
const GYRO: SensorKind = SensorKind {
    key: *b"GYRO",
    unit: "rad/s",
};
const ACCELEROMETER: SensorKind = SensorKind {
    key: *b"ACCL",
    unit: "m/s",
};

/// Reads the log. Accelerations are interpolated linearly at the times of the rates; there are none
/// where the axes of one of the two sensors are unknown.
///
/// # Errors
/// A damaged index; damaged settings; no track `gpmd`, or no `GYRO` in it; damaged payloads; fewer
/// than two samples.
pub fn read(mut video: VideoFile) -> Result<GyroLog, PoseError> {
    let index = video.index()?;
    let readout_ms = readout_ms(&index).map_err(|what| video.error(what))?;
    let [gyro, accelerometer] = read_sensors(&mut video, &index)?;
    if gyro.values.len() < 2 {
        return Err(video.error(format!(
            "its track `gpmd` has {} values of `GYRO`: this camera wrote no gyro; give a log of \
             gcsv, which Gyroflow writes",
            gyro.values.len()
        )));
    }
    let times = |sensor: &Sensor| sensor.times_s().map_err(|what| video.error(what));
    let times_s = times(&gyro)?;
    let accelerations_g = match in_axes_of(&gyro, &accelerometer) {
        Some(values_g) if values_g.len() > 1 => Some(Accelerations {
            times_s: times(&accelerometer)?,
            values_g,
        }),
        _ => None,
    };
    let sample = |(time_s, rate_rad_s): (f64, &Vector3<f64>)| GyroSample {
        time_s,
        rate_rad_s: *rate_rad_s,
        acceleration_g: accelerations_g.as_ref().map(|all| all.at(time_s)),
    };
    Ok(GyroLog {
        path: video.path().to_owned(),
        orientation: gyro.axes.map(Orientation::from_matrix),
        readout: readout_ms.map(|time_ms| Readout {
            time_ms,
            direction: ReadoutDirection::TopToBottom,
        }),
        rate_scale: None,
        samples: times_s.into_iter().zip(&gyro.values).map(sample).collect(),
    })
}

/// Reads gyro and accelerometer from all payloads that `index` names.
fn read_sensors(video: &mut VideoFile, index: &[u8]) -> Result<[Sensor; 2], PoseError> {
    let max_bytes = video.size().min(MAX_TABLE_BYTES);
    let payloads = payloads(index, *b"gpmd", max_bytes).map_err(|what| video.error(what))?;
    let Some(payloads) = payloads else {
        return Err(video.error(
            "has no track `gpmd`: this camera wrote no gyro; give a log of gcsv, which Gyroflow \
             writes for most cameras, or the GoPro's own file, which other programs may have \
             stripped of this track",
        ));
    };
    let mut sensors = [GYRO, ACCELEROMETER].map(Sensor::new);
    for (number, payload) in payloads.iter().enumerate() {
        let bytes = video.bytes(payload.position, payload.bytes)?;
        for sensor in &mut sensors {
            sensor.add(&bytes, payload.span_s).map_err(|what| {
                let start_s = payload.span_s[0];
                video.error(format!("payload {number}, at {start_s:.3} s: {what}"))
            })?;
        }
    }
    Ok(sensors)
}

/// Accelerations in the gyro's axes, multiples of g, if the axes of both sensors are known.
fn in_axes_of(gyro: &Sensor, accelerometer: &Sensor) -> Option<Vec<Vector3<f64>>> {
    let to_gyro = gyro.axes?.transpose() * accelerometer.axes?;
    let values = accelerometer.values.iter();
    Some(values.map(|a| to_gyro * a / GRAVITY_M_S2).collect())
}

/// Accelerations over time, at least two.
struct Accelerations {
    times_s: Vec<f64>,
    values_g: Vec<Vector3<f64>>,
}

impl Accelerations {
    /// The acceleration at a time; the first and the last one beyond the ends.
    fn at(&self, time_s: f64) -> Vector3<f64> {
        let after = self.times_s.partition_point(|t| *t <= time_s);
        let after = after.clamp(1, self.times_s.len() - 1);
        let [from_s, to_s] = [self.times_s[after - 1], self.times_s[after]];
        let part = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
        self.values_g[after - 1].lerp(&self.values_g[after], part)
    }
}
