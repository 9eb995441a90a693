//! `[poses]`: which files, and how they are to be read.

use super::associate::Associate;
use crate::trajectory::{CameraAxes, Direction, PoseFormat};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// `[poses]`. What is not given is told by the files' content and their formats' own conventions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PosesSection {
    /// The poses to be refined.
    pub initial: PathBuf,
    /// The true poses, where they are known: only ever used for comparison. Read as the initial
    /// ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<PathBuf>,
    /// The files' format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub format: Option<PoseFormat>,
    /// Which way the poses lead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub convention: Option<Direction>,
    /// How the camera's axes lie.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_axes: Option<CameraAxes>,
    /// The motion from the body whose poses the files hold to the camera; see
    /// [`read_camera_in_body`](crate::trajectory::read_camera_in_body).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_to_camera: Option<PathBuf>,
    /// Where the tunnel's axis lies in the poses' world; see
    /// [`read_tunnel_frame`](crate::trajectory::read_tunnel_frame).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tunnel_frame: Option<PathBuf>,
    /// What ties poses to frames: without it their names, if the file has any, else their order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub associate: Option<Associate>,
    /// The pose nearest in time may be this far from its frame, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_tolerance_s: Option<f64>,
    /// Whether a frame between two poses takes the one on the way between them, rather than the
    /// nearer one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolate: Option<bool>,
}

impl PosesSection {
    /// A section that says nothing but where the initial poses are.
    pub fn of(initial: impl Into<PathBuf>) -> Self {
        Self {
            initial: initial.into(),
            ..Self::default()
        }
    }
}
