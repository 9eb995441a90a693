//! The direction of poses and the axes of cameras.

use super::pose::Pose;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
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
    /// x forward, y left, z up, of a body of ROS (REP 103) whose x axis the camera looks along.
    Ros,
    /// x right, y up, z forward: left-handed, as is the world of the poses, whose y axis points
    /// up, too.
    Unity,
}

impl CameraAxes {
    /// All axes.
    pub const ALL: [Self; 4] = [Self::OpenCv, Self::OpenGl, Self::Ros, Self::Unity];

    /// The name in flags and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenCv => "opencv",
            Self::OpenGl => "opengl",
            Self::Ros => "ros",
            Self::Unity => "unity",
        }
    }

    /// Converts a camera-to-world pose from these axes to OpenCV's.
    ///
    /// `R ← R diag(1, −1, −1)` for OpenGL, which is its own inverse; `R ← R M` for ROS, where `M`
    /// has the rows (0, 0, 1), (−1, 0, 0) and (0, −1, 0); `R ← F R F`, `t ← F t` with
    /// `F = diag(1, −1, 1)` for Unity: camera and world are mirrored.
    pub fn turn(self, pose: &Pose) -> Pose {
        match self {
            Self::OpenCv => *pose,
            // Half a turn about x is exact: it only permutes the quaternion's components.
            Self::OpenGl => {
                let half_turn = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
                Pose::new(pose.r_wc * half_turn, pose.t_wc)
            }
            Self::Ros => {
                let optical = Quaternion::new(0.5, -0.5, 0.5, -0.5);
                Pose::new(
                    pose.r_wc * UnitQuaternion::new_unchecked(optical),
                    pose.t_wc,
                )
            }
            Self::Unity => {
                let (q, t) = (pose.r_wc, pose.t_wc);
                let mirrored = Quaternion::new(q.w, -q.i, q.j, -q.k);
                Pose::new(
                    UnitQuaternion::new_unchecked(mirrored),
                    Vector3::new(t.x, -t.y, t.z),
                )
            }
        }
    }
}
