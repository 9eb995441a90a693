//! The relation of the cameras of a rig.

use super::pose::Pose;
use super::so3;
use nalgebra::Vector3;

/// Several cameras on one body, and the uncertainty of their places on it.
///
/// Frames are in the order of their moments, and within a moment in that of the cameras, as those
/// of [`crate::camera::Cameras`].
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The pose of each camera in the body, `x_body = T x_camera`; at least one.
    mounts: Vec<Pose>,
    /// 1-σ of the rotation from one camera to the next, about each axis, radians.
    pub rotation_sigma_rad: f64,
    /// 1-σ of the translation from one camera to the next, along each axis, metres.
    pub translation_sigma_m: f64,
}

impl Rig {
    /// A rig of cameras with these poses in the body; None without cameras.
    pub fn new(
        mounts: Vec<Pose>,
        rotation_sigma_rad: f64,
        translation_sigma_m: f64,
    ) -> Option<Self> {
        (!mounts.is_empty()).then_some(Self {
            mounts,
            rotation_sigma_rad,
            translation_sigma_m,
        })
    }

    /// The rig with another uncertainty of rotation, radians, and translation, metres.
    #[must_use]
    pub fn with_sigmas(self, rotation_sigma_rad: f64, translation_sigma_m: f64) -> Self {
        Self {
            rotation_sigma_rad,
            translation_sigma_m,
            ..self
        }
    }

    /// Number of cameras.
    pub fn cameras(&self) -> usize {
        self.mounts.len()
    }

    /// The poses of the cameras in the body.
    pub fn mounts(&self) -> &[Pose] {
        &self.mounts
    }

    /// The camera that takes frame `frame`.
    pub fn camera_of(&self, frame: usize) -> usize {
        frame % self.mounts.len()
    }

    /// The first frame of the moment of frame `frame`.
    pub fn first_of_moment(&self, frame: usize) -> usize {
        frame - self.camera_of(frame)
    }

    /// The pose of frame `to` in the camera of frame `from` of the same moment, as mounted:
    /// `x_from = T x_to`.
    pub fn relation(&self, from: usize, to: usize) -> Pose {
        let [from, to] = [from, to].map(|frame| &self.mounts[self.camera_of(frame)]);
        from.inverse().after(to)
    }

    /// The pose of the body by the poses of a moment's frames, in the order of the cameras: the
    /// mean of those that each of them gives.
    pub fn body(&self, poses: &[Pose]) -> Pose {
        let bodies = poses.iter().zip(&self.mounts);
        let bodies: Vec<Pose> = bodies
            .map(|(pose, mount)| pose.after(&mount.inverse()))
            .collect();
        let Some(first) = bodies.first() else {
            return Pose::identity();
        };
        let count = bodies.len() as f64;
        // They differ by so little that the mean of their rotation vectors is that of rotations.
        let turn = |body: &Pose| so3::log(&(first.r_wc.inverse() * body.r_wc));
        let turn = bodies.iter().map(turn).sum::<Vector3<f64>>() / count;
        let shift = |body: &Pose| body.t_wc - first.t_wc;
        let shift = bodies.iter().map(shift).sum::<Vector3<f64>>() / count;
        Pose::new(first.r_wc * so3::exp(&turn), first.t_wc + shift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(a: f64, b: f64, c: f64) -> Pose {
        Pose::new(so3::exp(&Vector3::new(a, b, c)), Vector3::new(b, c, a))
    }

    #[test]
    fn cameras_lead_to_the_body_and_to_each_other() {
        let mounts = vec![pose(0.1, 2.0, -0.4), pose(1.0, 0.3, 0.2)];
        let rig = Rig::new(mounts, 1e-3, 1e-3).unwrap();
        let body = pose(-0.5, 0.4, 2.0);
        let poses: Vec<Pose> = rig.mounts().iter().map(|mount| body.after(mount)).collect();
        assert!(rig.body(&poses).local(&body).norm() < 1e-12);
        let second = poses[0].after(&rig.relation(4, 5));
        assert!(second.local(&poses[1]).norm() < 1e-12);
        assert_eq!((rig.camera_of(5), rig.first_of_moment(5)), (1, 4));
        assert!(Rig::new(Vec::new(), 1.0, 1.0).is_none());
    }

    #[test]
    fn the_body_is_in_the_middle_of_what_its_cameras_say() {
        let rig = Rig::new(vec![Pose::identity(); 2], 1e-3, 1e-3).unwrap();
        let poses =
            [-1e-3, 1e-3].map(|x| Pose::new(so3::exp(&(Vector3::x() * x)), Vector3::y() * x));
        assert!(rig.body(&poses).local(&Pose::identity()).norm() < 1e-15);
    }
}
