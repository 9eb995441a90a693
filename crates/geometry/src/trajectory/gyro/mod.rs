//! Rotations from a gyroscope's log.
//!
//! A [`GyroLog`] is the file, gcsv or the video of a GoPro; an [`Orientation`] or a calibrated
//! mount converts its rates to the camera's axes ([`AngularRates`]). An interval at rest
//! ([`StationaryInterval`]) gives the bias, the noise density and the direction of gravity;
//! [`IntegratedRotation`] integrates the rates to rotations at the frames' times; [`ClockMatch`]
//! estimates the offset between the log's clock and that of a plan; [`RotationNoise`] is the
//! uncertainty of the rotations. [`baseline_from_gyro`] combines these steps, from the log to one
//! pose per frame.

mod baseline;
mod clock_offset;
mod gcsv;
mod gopro;
mod gravity;
mod integration;
mod log;
mod noise;
mod orientation;
mod rate_unit;
mod rates;
mod reader;
mod stationary;

#[cfg(test)]
mod consistency_tests;

pub use baseline::{
    ClockOffset, FrameStations, GyroBaseline, GyroOptions, InitialAttitude, StationaryChoice,
    baseline_from_gyro,
};
pub use clock_offset::ClockMatch;
pub use gopro::gopro_readout_ms;
pub use gravity::{angle_from_gravity_rad, axis_in_camera};
pub use integration::IntegratedRotation;
pub use log::{GyroLog, GyroSample, Readout, ReadoutDirection};
pub use noise::RotationNoise;
pub use orientation::Orientation;
pub use rates::AngularRates;
pub use stationary::{MAX_BIAS_RAD_S, StationaryInterval};
