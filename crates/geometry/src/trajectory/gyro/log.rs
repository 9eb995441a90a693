//! A gyroscope's log in memory.

use super::orientation::Orientation;
use super::rates::AngularRates;
use nalgebra::{Matrix3, Vector3};
use std::path::PathBuf;

/// One sample of a log, in the sensor's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroSample {
    /// Seconds of the log's clock.
    pub time_s: f64,
    /// Angular rates by the right-hand rule, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Specific force, multiples of g; at rest it points up.
    pub acceleration_g: Option<Vector3<f64>>,
}

/// The readout direction of a rolling shutter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadoutDirection {
    /// From the first row to the last.
    TopToBottom,
    /// From the last row to the first.
    BottomToTop,
    /// Column by column, which this program does not support.
    Sideways,
}

/// The readout of a rolling shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readout {
    /// Time from the first row to the last, milliseconds.
    pub time_ms: f64,
    /// The readout direction.
    pub direction: ReadoutDirection,
}

/// A gyroscope's log with at least two samples of increasing times.
#[derive(Clone, Debug)]
pub struct GyroLog {
    /// The file.
    pub path: PathBuf,
    /// Orientation of the sensor in the camera, if given.
    pub orientation: Option<Orientation>,
    /// Readout of the camera's rolling shutter, if given.
    pub readout: Option<Readout>,
    /// Factor from the file's values to rad/s, its `gscale`, if a header states it.
    pub rate_scale: Option<f64>,
    /// The samples.
    pub samples: Vec<GyroSample>,
}

impl GyroLog {
    /// The rates in camera coordinates; `to_camera` maps the sensor's axes to the camera's.
    pub fn rates(&self, to_camera: &Matrix3<f64>) -> AngularRates {
        let samples = self.samples.iter();
        AngularRates::new(
            samples.clone().map(|sample| sample.time_s).collect(),
            samples
                .map(|sample| to_camera * sample.rate_rad_s)
                .collect(),
        )
    }
}
