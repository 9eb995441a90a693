//! The direction of poses and the axes of cameras.

use super::pose::Pose;
use nalgebra::{Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// The direction of a pose's transformation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// From the camera (or the body) to the world: the translation is the camera's position.
    #[serde(rename = "c2w")]
    CameraToWorld,
    /// From the world to the camera.
    #[serde(rename = "w2c")]
    WorldToCamera,
}

impl Direction {
    /// The opposite direction.
    pub fn other(self) -> Self {
        match self {
            Self::CameraToWorld => Self::WorldToCamera,
            Self::WorldToCamera => Self::CameraToWorld,
        }
    }

    /// The name in flags and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::CameraToWorld => "c2w",
            Self::WorldToCamera => "w2c",
        }
    }
}

/// The orientation of a camera's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraAxes {
    /// x right, y down, z forward.
    OpenCv,
    /// x right, y up, z backwards.
    OpenGl,
}

impl CameraAxes {
    /// The other convention.
    pub fn other(self) -> Self {
        match self {
            Self::OpenCv => Self::OpenGl,
            Self::OpenGl => Self::OpenCv,
        }
    }

    /// The name in flags and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenCv => "opencv",
            Self::OpenGl => "opengl",
        }
    }

    /// Converts a camera-to-world pose between these axes and OpenCV's, in either direction:
    /// `R ← R diag(1, −1, −1)` for OpenGL.
    pub fn turn(self, pose: &Pose) -> Pose {
        match self {
            Self::OpenCv => *pose,
            // Half a turn about x is exact: it only permutes the quaternion's components.
            Self::OpenGl => {
                let half_turn = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
                Pose::new(pose.r_wc * half_turn, pose.t_wc)
            }
        }
    }
}
