//! The direction of poses and the axes of cameras.

use super::pose::Pose;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

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
#[serde(rename_all = "kebab-case")]
pub enum CameraAxes {
    /// x right, y down, z forward.
    #[serde(rename = "opencv")]
    OpenCv,
    /// x right, y up, z backwards.
    #[serde(rename = "opengl")]
    OpenGl,
    /// x forward, y left, z up, of a body of ROS (REP 103) whose x axis the camera looks along.
    Ros,
    /// x right, y up, z forward: left-handed, as is the world of the poses, whose y axis points
    /// up, too.
    Unity,
    /// x down, y left, z forward: OpenCV's of pictures that are turned clockwise by a quarter after
    /// the camera stored them.
    TurnedRight,
    /// x up, y right, z forward: OpenCV's of pictures that are turned anticlockwise likewise.
    TurnedLeft,
}

impl CameraAxes {
    /// The axes of programs that write poses.
    pub const ALL: [Self; 4] = [Self::OpenCv, Self::OpenGl, Self::Ros, Self::Unity];

    /// The axes of a camera in whose pictures, as stored, the EXIF orientation asks for a quarter
    /// of a turn; None for all other orientations.
    pub fn before_turning(exif_orientation: u8) -> Option<Self> {
        match exif_orientation {
            6 => Some(Self::TurnedRight),
            8 => Some(Self::TurnedLeft),
            _ => None,
        }
    }

    /// The name in flags and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenCv => "opencv",
            Self::OpenGl => "opengl",
            Self::Ros => "ros",
            Self::Unity => "unity",
            Self::TurnedRight => "turned-right",
            Self::TurnedLeft => "turned-left",
        }
    }

    /// Converts a camera-to-world pose from these axes to OpenCV's.
    ///
    /// `R ← R diag(1, −1, −1)` for OpenGL, which is its own inverse; `R ← R M` for ROS, where `M`
    /// has the rows (0, 0, 1), (−1, 0, 0) and (0, −1, 0); `R ← F R F`, `t ← F t` with
    /// `F = diag(1, −1, 1)` for Unity: camera and world are mirrored; `R ← R Rz(∓90°)` for
    /// pictures turned right and left.
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
            Self::TurnedRight => quarter_turn(pose, -1.0),
            Self::TurnedLeft => quarter_turn(pose, 1.0),
        }
    }
}

/// A pose whose camera is turned about its z axis by 90° times `sign`.
fn quarter_turn(pose: &Pose, sign: f64) -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sign * FRAC_PI_2);
    Pose::new(pose.r_wc * turn, pose.t_wc)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The right edge of a stored picture is the lower edge of one that is turned clockwise.
    #[test]
    fn pictures_are_turned_as_their_names_say() {
        let stored = Pose::identity();
        for (axes, right_in_turned) in [
            (CameraAxes::TurnedRight, Vector3::y()),
            (CameraAxes::TurnedLeft, -Vector3::y()),
        ] {
            let turned = axes.turn(&stored).r_wc;
            let seen = turned.inverse() * Vector3::x();
            assert!((seen - right_in_turned).norm() < 1e-12, "{axes:?}: {seen}");
            assert!((turned * Vector3::z() - Vector3::z()).norm() < 1e-12);
        }
    }
}
