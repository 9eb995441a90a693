//! Pose conventions: direction, camera axes, body and world frame.

use super::axes::{CameraAxes, Direction};
use super::format::PoseFormat;
use super::pose::Pose;

/// The convention of a file of poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convention {
    /// The direction of the poses.
    pub direction: Direction,
    /// The camera's axes.
    pub axes: CameraAxes,
    /// The camera in the body whose poses the file holds, `x_body = T x_camera`; `None` if they are
    /// the camera's own.
    pub camera_in_body: Option<Pose>,
    /// The tunnel's frame in the world of the poses, `x_world = T x_tunnel`; `None` if they are the
    /// same.
    pub tunnel_in_world: Option<Pose>,
}

impl Convention {
    /// The default convention of a format.
    pub fn of(format: PoseFormat) -> Self {
        Self {
            direction: format.direction(),
            axes: format.axes(),
            camera_in_body: None,
            tunnel_in_world: None,
        }
    }

    /// Converts a pose to the program's convention: camera-to-world, OpenCV's axes, the tunnel's
    /// axis along y.
    ///
    /// `T = T_world,tunnel⁻¹ T_world,body T_body,camera`, then the camera's axes. A pose that
    /// already has this convention is returned bit for bit.
    pub fn to_tunnel(&self, given: &Pose) -> Pose {
        let mut pose = self.to_world(given);
        if let Some(tunnel) = &self.tunnel_in_world {
            pose = tunnel.inverse().after(&pose);
        }
        pose
    }

    /// Converts a pose to camera-to-world with OpenCV's axes in the world of the file.
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
        // Twice is a full turn: the same rotation with the quaternion's sign changed.
        let twice = CameraAxes::OpenGl.turn(&turned);
        assert_eq!(twice.r_wc.coords, -pose.r_wc.coords);
    }

    /// The camera of a robot looks along its body's x axis, its right is the body's −y.
    #[test]
    fn bodies_and_left_handed_poses_are_turned_as_their_matrices_say() {
        let pose = pose(0.1, 2.0, -0.4);
        let turned = CameraAxes::Ros.turn(&pose);
        for (camera, body) in [
            (Vector3::z(), Vector3::x()),
            (Vector3::x(), -Vector3::y()),
            (Vector3::y(), -Vector3::z()),
        ] {
            assert!((turned.r_wc * camera - pose.r_wc * body).norm() < 1e-15);
        }
        let mirror = nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        let turned = CameraAxes::Unity.turn(&pose);
        let [own, given] = [turned, pose].map(|p| p.r_wc.to_rotation_matrix().into_inner());
        assert!((own - mirror * given * mirror).norm() < 1e-14);
        assert_eq!(turned.t_wc, mirror * pose.t_wc);
    }

    #[test]
    fn a_pose_of_the_programs_own_convention_stays_to_the_bit() {
        let pose = pose(0.1, 2.0, -0.4);
        assert_eq!(Convention::of(PoseFormat::Tum).to_tunnel(&pose), pose);
    }
}
