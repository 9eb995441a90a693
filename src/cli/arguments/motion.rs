//! Arguments of the carrier's planned motion and of the camera's mounting.

use super::frame_times::clock_times;
use super::input_file::input_file;
use super::numbers::numbers;
use crate::cli::output::Failure;
use crate::survey::FrameTimes;
use crate::trajectory::{Mounting, PlanTable, Rate, Station, UniformMotion};
use std::path::PathBuf;

/// Planned motion of the carrier.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Carrier")]
pub struct MotionArguments {
    /// Advance along the axis per frame, metres [default: 0].
    #[arg(long, value_name = "M", conflicts_with = "advance_m_per_s")]
    advance_m: Option<f64>,
    /// Advance along the axis per second, metres.
    #[arg(long, value_name = "M")]
    advance_m_per_s: Option<f64>,
    /// Read the plan from a CSV table instead, with the columns frame (from 0) or time_s,
    /// chainage_m, angle_deg, and x_m and z_m if the carrier is off the axis. Values between rows
    /// are interpolated linearly; angles are unwrapped and may exceed 360.
    #[arg(
        long,
        value_name = "CSV",
        value_parser = input_file(),
        conflicts_with_all = [
            "advance_m", "advance_m_per_s", "start_angle_deg", "start_chainage_m", "offset_m"
        ]
    )]
    table: Option<PathBuf>,
    /// Angle θ at the first frame, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    start_angle_deg: f64,
    /// Chainage of the first frame, metres.
    #[arg(long, value_name = "M", default_value_t = 0.0)]
    start_chainage_m: f64,
    /// Offset of the carrier from the axis along the world's x and z, metres.
    #[arg(
        long,
        value_name = "X,Z",
        default_value = "0,0",
        value_parser = numbers::<2>,
        allow_hyphen_values = true
    )]
    offset_m: [f64; 2],
}

/// Mounting of the camera on the carrier.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Mounting")]
pub struct MountingArguments {
    /// Tilt of the camera towards larger chainage, degrees; at 0 it looks straight at the wall.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    tilt_deg: f64,
    /// Roll of the camera clockwise about its optical axis, degrees. At 0 the image's right points
    /// to larger θ and its lower edge ahead; at 90 its right points ahead.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    roll_deg: f64,
    /// Lever arm from the axis of rotation to the projection centre, perpendicular to the axis
    /// towards the wall in front of the camera, metres.
    #[arg(long, value_name = "M", default_value_t = 0.0)]
    arm_m: f64,
}

impl MotionArguments {
    /// Stations of the carrier at the frames; `turn_rad` is its turn if there is no table.
    ///
    /// # Errors
    /// A malformed table or one that does not cover the frames; a rate per second if no clock is
    /// known.
    pub fn stations(&self, turn_rad: Rate, frames: &FrameTimes) -> Result<Vec<Station>, Failure> {
        if let Some(path) = &self.table {
            let table = PlanTable::read(path)?;
            if table.is_by_time() {
                clock_times(frames, "a --table with a column time_s")?;
            }
            return Ok(table.stations(&frames.times_s)?);
        }
        let advance_m = match self.advance_m_per_s {
            Some(rate) => {
                clock_times(frames, "--advance-m-per-s")?;
                Rate::PerSecond(rate)
            }
            None => Rate::PerFrame(self.advance_m.unwrap_or_default()),
        };
        let plan = UniformMotion {
            start: Station {
                chainage_m: self.start_chainage_m,
                angle_rad: self.start_angle_deg.to_radians(),
                offset_m: self.offset_m,
            },
            advance_m,
            turn_rad,
        };
        Ok(plan.stations(&frames.times_s))
    }

    /// The file of the plan, if there is one.
    pub fn file(&self) -> Option<&PathBuf> {
        self.table.as_ref()
    }

    /// True if any motion is given.
    pub fn is_given(&self) -> bool {
        self.table.is_some() || self.advance_m.is_some() || self.advance_m_per_s.is_some()
    }
}

impl MountingArguments {
    /// The mounting.
    pub fn mounting(&self) -> Mounting {
        Mounting {
            tilt_rad: self.tilt_deg.to_radians(),
            roll_rad: self.roll_deg.to_radians(),
            arm_m: self.arm_m,
        }
    }
}
