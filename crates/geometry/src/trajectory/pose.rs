//! The pose of one frame.

use super::so3;
use nalgebra::{UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// Camera-to-world pose: `x_w = R_wc x_c + t_wc` (metres).
///
/// The camera looks along its +z, x to the right, y down; the tunnel's axis is the world's +y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Rotation from camera to world.
    pub r_wc: UnitQuaternion<f64>,
    /// Camera centre in the world, metres.
    pub t_wc: Vector3<f64>,
}

impl Pose {
    /// The camera at the world's origin, looking along +z.
    pub fn identity() -> Self {
        Self {
            r_wc: UnitQuaternion::identity(),
            t_wc: Vector3::zeros(),
        }
    }

    /// A pose from rotation and translation.
    pub fn new(r_wc: UnitQuaternion<f64>, t_wc: Vector3<f64>) -> Self {
        Self { r_wc, t_wc }
    }

    /// Transforms a point from camera to world: `R_wc x_c + t_wc`.
    #[inline]
    pub fn to_world(&self, x_c: &Vector3<f64>) -> Vector3<f64> {
        self.r_wc * x_c + self.t_wc
    }

    /// Transforms a point from world to camera: `R_wcᵀ (x_w − t_wc)`.
    #[inline]
    pub fn to_camera(&self, x_w: &Vector3<f64>) -> Vector3<f64> {
        self.r_wc.inverse_transform_vector(&(x_w - self.t_wc))
    }

    /// The inverse transformation: `x_c = R_wcᵀ x_w − R_wcᵀ t_wc`.
    pub fn inverse(&self) -> Self {
        let r_cw = self.r_wc.inverse();
        Self::new(r_cw, -(r_cw * self.t_wc))
    }

    /// The composition of `other`, then `self`: `R ← R R_other`, `t ← R t_other + t`.
    pub fn after(&self, other: &Self) -> Self {
        Self::new(self.r_wc * other.r_wc, self.r_wc * other.t_wc + self.t_wc)
    }

    /// Moves the pose along the tangent vector `ξ = (ω, ρ)`: `R ← R Exp(ω)`, `t ← t + ρ`.
    ///
    /// ω in radians about the camera's axes, ρ in metres along the world's.
    pub fn retract(&self, xi: &Vector6<f64>) -> Self {
        let omega: Vector3<f64> = xi.fixed_rows::<3>(0).into();
        let rho: Vector3<f64> = xi.fixed_rows::<3>(3).into();
        Self {
            r_wc: UnitQuaternion::new_normalize((self.r_wc * so3::exp(&omega)).into_inner()),
            t_wc: self.t_wc + rho,
        }
    }

    /// The tangent vector from `self` to `other`; inverse of [`Pose::retract`].
    pub fn local(&self, other: &Self) -> Vector6<f64> {
        let omega = so3::log(&(self.r_wc.inverse() * other.r_wc));
        let rho = other.t_wc - self.t_wc;
        Vector6::new(omega.x, omega.y, omega.z, rho.x, rho.y, rho.z)
    }

    /// True if every number is finite.
    pub fn is_finite(&self) -> bool {
        self.t_wc.iter().all(|v| v.is_finite()) && self.r_wc.coords.iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn local_inverts_retract() {
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.4, -1.0, 0.3)),
            Vector3::new(0.1, 5.0, -0.2),
        );
        let xi = Vector6::new(0.05, -0.02, 0.3, 0.1, -0.2, 0.05);
        assert!((pose.local(&pose.retract(&xi)) - xi).norm() < 1e-12);
    }

    #[test]
    fn motions_follow_each_other() {
        let first = Pose::new(so3::exp(&Vector3::new(0.4, -1.0, 0.3)), Vector3::x());
        let then = Pose::new(so3::exp(&Vector3::new(-0.2, 0.1, 2.0)), Vector3::y());
        let x = Vector3::new(0.3, -0.8, 2.0);
        let both = then.to_world(&first.to_world(&x));
        assert!((then.after(&first).to_world(&x) - both).norm() < 1e-12);
        assert!((first.inverse().to_world(&x) - first.to_camera(&x)).norm() < 1e-12);
    }

    #[test]
    fn world_and_camera_are_inverse() {
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.4, -1.0, 0.3)),
            Vector3::new(0.1, 5.0, -0.2),
        );
        let x_c = Vector3::new(0.3, -0.8, 2.0);
        assert!((pose.to_camera(&pose.to_world(&x_c)) - x_c).norm() < 1e-12);
    }
}
