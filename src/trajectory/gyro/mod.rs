//! Rotations from a gyro's log.
//!
//! A [`GyroLog`] is the file; an [`Orientation`] or a calibrated mount turns its rates into the
//! camera's axes ([`AngularRates`]). A stretch at rest ([`StationaryInterval`]) tells the bias, the noise density and
//! which way is up; [`IntegratedRotation`] integrates what is left to rotations at the frames' times;
//! [`ClockMatch`] finds how the log's clock stands to that of a plan; [`RotationNoise`] says how
//! far the rotations may be off. [`baseline_from_gyro`] is all of it, from the log to one pose a
//! frame.

mod baseline;
mod clock_offset;
mod gcsv;
mod gravity;
mod integration;
mod noise;
mod orientation;
mod rates;
mod stationary;

#[cfg(test)]
mod consistency_tests;

pub use baseline::{
    ClockOffset, FrameStations, GyroBaseline, GyroOptions, InitialAttitude, StationaryChoice,
    baseline_from_gyro,
};
pub use clock_offset::ClockMatch;
pub use gcsv::{GyroLog, GyroSample, Readout, ReadoutDirection};
pub use gravity::{angle_from_gravity_rad, axis_in_camera};
pub use integration::IntegratedRotation;
pub use noise::RotationNoise;
pub use orientation::Orientation;
pub use rates::AngularRates;
pub use stationary::{MAX_BIAS_RAD_S, StationaryInterval};
