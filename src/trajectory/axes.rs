//! The direction of poses and the axes of cameras.

use super::pose::Pose;
use nalgebra::{Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// Which way a pose leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// From the camera (or the body) to the world: the translation is where it stands.
    #[serde(rename = "c2w")]
    CameraToWorld,
    /// From the world to the camera.
    #[serde(rename = "w2c")]
    WorldToCamera,
}

impl Direction {
    /// The other one.
    pub fn other(self) -> Self {
        match self {
            Self::CameraToWorld => Self::WorldToCamera,
            Self::WorldToCamera => Self::CameraToWorld,
        }
    }

    /// As flags and files name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::CameraToWorld => "c2w",
            Self::WorldToCamera => "w2c",
        }
    }
}

/// How a camera's axes lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum CameraAxes {
    /// x right, y down, z forward.
    OpenCv,
    /// x right, y up, z backwards.
    OpenGl,
}

impl CameraAxes {
    /// The other ones.
    pub fn other(self) -> Self {
        match self {
            Self::OpenCv => Self::OpenGl,
            Self::OpenGl => Self::OpenCv,
        }
    }

    /// As flags and files name them.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenCv => "opencv",
            Self::OpenGl => "opengl",
        }
    }

    /// A camera-to-world pose of these axes in OpenCV's, and the other way round:
    /// `R ← R diag(1, −1, −1)` for OpenGL.
    pub fn turn(self, pose: &Pose) -> Pose {
        match self {
            Self::OpenCv => *pose,
            // Half a turn about x: exact, since it only swaps the quaternion's numbers.
            Self::OpenGl => {
                let half_turn = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
                Pose::new(pose.r_wc * half_turn, pose.t_wc)
            }
        }
    }
}
