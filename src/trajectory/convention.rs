//! What the numbers of a pose mean: its direction, the camera's axes, whose pose it is, and in
//! which world.

use super::pose::Pose;

use super::format::PoseFormat;
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

/// The convention of a file of poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convention {
    /// Which way its poses lead.
    pub direction: Direction,
    /// How the camera's axes lie.
    pub axes: CameraAxes,
    /// The camera in the body whose poses the file holds, `x_body = T x_camera`; `None` if they are
    /// the camera's own.
    pub camera_in_body: Option<Pose>,
    /// The tunnel's frame in the world of the poses, `x_world = T x_tunnel`; `None` if they are the
    /// same.
    pub tunnel_in_world: Option<Pose>,
}

impl Convention {
    /// What a format means where nothing else is said.
    pub fn of(format: PoseFormat) -> Self {
        Self {
            direction: format.direction(),
            axes: format.axes(),
            camera_in_body: None,
            tunnel_in_world: None,
        }
    }

    /// The pose as the program has it: camera-to-world, OpenCV's axes, the tunnel's axis along y.
    ///
    /// `T = T_world,tunnel⁻¹ T_world,body T_body,camera`, then the camera's axes. A pose that has
    /// this convention already is returned to the bit.
    pub fn to_tunnel(&self, given: &Pose) -> Pose {
        let mut pose = self.to_world(given);
        if let Some(tunnel) = &self.tunnel_in_world {
            pose = tunnel.inverse().after(&pose);
        }
        pose
    }

    /// The same in the world of the file.
    pub fn to_world(&self, given: &Pose) -> Pose {
        let mut pose = match self.direction {
            Direction::CameraToWorld => *given,
            Direction::WorldToCamera => given.inverse(),
        };
        if let Some(camera) = &self.camera_in_body {
            pose = pose.after(camera);
        }
        self.axes.turn(&pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::so3;
    use nalgebra::Vector3;

    fn pose(a: f64, b: f64, c: f64) -> Pose {
        Pose::new(so3::exp(&Vector3::new(a, b, c)), Vector3::new(b, c, a))
    }

    #[test]
    fn every_part_is_undone() {
        let (camera_in_tunnel, camera_in_body, tunnel_in_world) = (
            pose(0.1, 2.0, -0.4),
            pose(1.0, 0.3, 0.2),
            pose(-0.5, 0.4, 2.0),
        );
        let gl = CameraAxes::OpenGl.turn(&camera_in_tunnel);
        let body_in_world = tunnel_in_world.after(&gl).after(&camera_in_body.inverse());
        let convention = Convention {
            direction: Direction::WorldToCamera,
            axes: CameraAxes::OpenGl,
            camera_in_body: Some(camera_in_body),
            tunnel_in_world: Some(tunnel_in_world),
        };
        let back = convention.to_tunnel(&body_in_world.inverse());
        assert!(back.local(&camera_in_tunnel).norm() < 1e-12);
    }

    #[test]
    fn axes_are_turned_as_the_matrix_says_and_exactly() {
        let pose = pose(0.1, 2.0, -0.4);
        let turned = CameraAxes::OpenGl.turn(&pose);
        for (axis, sign) in [
            (Vector3::x(), 1.0),
            (Vector3::y(), -1.0),
            (Vector3::z(), -1.0),
        ] {
            assert!((turned.r_wc * axis - pose.r_wc * axis * sign).norm() < 1e-15);
        }
        // Twice is a whole turn: the same rotation, the quaternion's sign changed.
        let twice = CameraAxes::OpenGl.turn(&turned);
        assert_eq!(twice.r_wc.coords, -pose.r_wc.coords);
    }

    #[test]
    fn a_pose_of_the_programs_own_convention_stays_to_the_bit() {
        let pose = pose(0.1, 2.0, -0.4);
        assert_eq!(Convention::of(PoseFormat::Tum).to_tunnel(&pose), pose);
    }
}
