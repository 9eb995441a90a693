//! How the carrier moves, and how the camera sits on it.

use super::Failure;
use super::frame_times::FrameTimes;
use crate::trajectory::{Mounting, PlanTable, Rate, Station, UniformMotion};
use std::path::PathBuf;

/// Where the carrier goes.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Carrier")]
pub struct WayArguments {
    /// Advance along the axis from frame to frame, metres [default: 0].
    #[arg(long, value_name = "M", conflicts_with = "advance_m_per_s")]
    advance_m: Option<f64>,
    /// Advance along the axis each second, metres.
    #[arg(long, value_name = "M")]
    advance_m_per_s: Option<f64>,
    /// The plan as a table instead: CSV with columns frame (from 0) or time_s, chainage_m,
    /// angle_deg, and x_m and z_m if the carrier is off the axis. Between rows all changes evenly;
    /// angles count as they are given, beyond 360 too.
    #[arg(
        long,
        value_name = "CSV",
        conflicts_with_all = ["advance_m", "advance_m_per_s", "start_angle_deg", "start_chainage_m", "offset_m"]
    )]
    table: Option<PathBuf>,
    /// Angle θ at the first frame, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    start_angle_deg: f64,
    /// Chainage of the first frame, metres.
    #[arg(long, value_name = "M", default_value_t = 0.0)]
    start_chainage_m: f64,
    /// Where the carrier is off the axis, along the world's x and z, metres.
    #[arg(long, value_name = "X,Z", default_value = "0,0", value_parser = numbers::<2>, allow_hyphen_values = true)]
    offset_m: [f64; 2],
}

/// How the camera sits on the carrier.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Mounting")]
pub struct MountingArguments {
    /// How far the camera looks ahead, towards larger chainage, degrees; 0 is straight at the wall.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    tilt_deg: f64,
    /// How far the camera is turned clockwise about its line of sight, degrees: at 0 the picture's
    /// right is towards larger θ and its lower edge ahead, at 90 its right is ahead.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    roll_deg: f64,
    /// How far the lens is from the axis of the turn, towards where the camera points, metres.
    #[arg(long, value_name = "M", default_value_t = 0.0)]
    arm_m: f64,
}

/// N finite numbers with commas between.
///
/// # Errors
/// Anything else.
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parse = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let values: Option<Vec<f64>> = text.split(',').map(parse).collect();
    values
        .and_then(|values| <[f64; N]>::try_from(values).ok())
        .ok_or_else(|| format!("must be {N} numbers with commas between"))
}

impl WayArguments {
    /// Where the carrier stands at the frames, if it turns by `turn_rad` where no table says
    /// otherwise.
    ///
    /// # Errors
    /// A malformed table or one that does not cover the frames; something that goes by the second
    /// where no clock is known.
    pub fn stations(&self, turn_rad: Rate, frames: &FrameTimes) -> Result<Vec<Station>, Failure> {
        if let Some(path) = &self.table {
            let table = PlanTable::read(path)?;
            if table.is_by_time() {
                frames.clock("a --table that goes by time")?;
            }
            return Ok(table.stations(&frames.times_s)?);
        }
        let advance_m = match self.advance_m_per_s {
            Some(rate) => {
                frames.clock("--advance-m-per-s")?;
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

    /// The file that tells it, if there is one.
    pub fn file(&self) -> Option<&PathBuf> {
        self.table.as_ref()
    }

    /// Whether anything tells the way.
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
