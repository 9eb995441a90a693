//! The columns of poses, and the names that a user gives them.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;

/// A column of a table of poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseColumn {
    /// Name of the frame.
    Frame,
    /// Time, seconds.
    TimeS,
    /// Time, milliseconds.
    TimeMs,
    /// Time, microseconds.
    TimeUs,
    /// Time, whole nanoseconds.
    TimeNs,
    /// Translation along x, metres.
    Tx,
    /// Translation along y, metres.
    Ty,
    /// Translation along z, metres.
    Tz,
    /// The quaternion's x.
    Qx,
    /// The quaternion's y.
    Qy,
    /// The quaternion's z.
    Qz,
    /// The quaternion's w.
    Qw,
    /// Angle about x: roll, ω.
    Rx,
    /// Angle about y: pitch, φ.
    Ry,
    /// Angle about z: yaw, heading, κ.
    Rz,
}

/// Names of columns in the header of a file, for columns whose names are not known.
pub type ColumnMap = BTreeMap<PoseColumn, String>;

impl PoseColumn {
    /// All columns.
    pub const ALL: [Self; 15] = [
        Self::Frame,
        Self::TimeS,
        Self::TimeMs,
        Self::TimeUs,
        Self::TimeNs,
        Self::Tx,
        Self::Ty,
        Self::Tz,
        Self::Qx,
        Self::Qy,
        Self::Qz,
        Self::Qw,
        Self::Rx,
        Self::Ry,
        Self::Rz,
    ];
    /// The columns of a translation.
    pub(super) const TRANSLATION: [Self; 3] = [Self::Tx, Self::Ty, Self::Tz];
    /// The columns of a quaternion.
    pub(super) const QUATERNION: [Self; 4] = [Self::Qx, Self::Qy, Self::Qz, Self::Qw];
    /// The columns of angles about x, y and z.
    pub(super) const ANGLES: [Self; 3] = [Self::Rx, Self::Ry, Self::Rz];

    /// The name in survey.toml and in flags.
    pub fn name(self) -> &'static str {
        match self {
            Self::Frame => "frame",
            Self::TimeS => "time_s",
            Self::TimeMs => "time_ms",
            Self::TimeUs => "time_us",
            Self::TimeNs => "time_ns",
            Self::Tx => "tx",
            Self::Ty => "ty",
            Self::Tz => "tz",
            Self::Qx => "qx",
            Self::Qy => "qy",
            Self::Qz => "qz",
            Self::Qw => "qw",
            Self::Rx => "rx",
            Self::Ry => "ry",
            Self::Rz => "rz",
        }
    }
}

impl FromStr for PoseColumn {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let column = Self::ALL.into_iter().find(|column| column.name() == name);
        column.ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join("`, `");
            format!("`{name}` is no column of poses; these are `{known}`")
        })
    }
}
