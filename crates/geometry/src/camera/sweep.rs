//! Rolling shutter: the camera moves while the rows of an image are read, so every row has its own
//! pose.

use nalgebra::{Rotation3, Vector3};

/// The motion of a camera while the rows of one image are read: a constant velocity with rotation ω
/// (radians) and translation ν (metres), in camera coordinates at the time of the middle row.
///
/// Row v of an image of H rows is read at the share `τ = (v − (H − 1)/2)/H` of that time, from −½
/// to ½. The camera has then turned by `Exp(ω τ)` and moved by `ν τ`: a point x_c in the
/// coordinates of the middle row has the coordinates
///
/// `x_c(τ) = Exp(−ω τ) (x_c − ν τ)`
///
/// at row v. The share of a row stays the same in a halved image ([`super::Camera::at_level`]), to
/// within half a row if the number of rows was odd.
///
/// Source: M. Meingast, C. Geyer, S. Sastry, "Geometric models of rolling-shutter cameras", OMNIVIS
/// 2005.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sweep {
    /// ω, radians.
    pub omega_rad: Vector3<f64>,
    /// ν, metres.
    pub nu_m: Vector3<f64>,
}

/// Largest share |τ|: rows farther than half the image's height beyond its border are treated as if
/// they were read there.
pub(super) const MAX_SHARE: f64 = 1.0;

impl Sweep {
    /// True for a global shutter or a camera at rest.
    #[inline]
    pub fn is_none(&self) -> bool {
        let is_zero = |v: &Vector3<f64>| v.x == 0.0 && v.y == 0.0 && v.z == 0.0;
        is_zero(&self.omega_rad) && is_zero(&self.nu_m)
    }

    /// The motion during `factor` times the readout time.
    #[inline]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            omega_rad: self.omega_rad * factor,
            nu_m: self.nu_m * factor,
        }
    }

    /// `Exp(ω τ)`: the rotation from the coordinates of the row at share τ to those of the middle
    /// row.
    pub(super) fn rotation_at(&self, share: f64) -> Rotation3<f64> {
        Rotation3::new(self.omega_rad * share)
    }

    /// `x_c(τ)`: the point in the coordinates of the row at share τ.
    pub(super) fn point_at(&self, x_c: &Vector3<f64>, share: f64) -> Vector3<f64> {
        self.rotation_at(-share) * (x_c - self.nu_m * share)
    }

    /// `∂x_c(τ)/∂τ = −ω × x_c(τ) − Exp(−ω τ) ν` of a point that lies at `at` in the row's
    /// coordinates.
    pub(super) fn point_rate(&self, at: &Vector3<f64>, share: f64) -> Vector3<f64> {
        -self.omega_rad.cross(at) - self.rotation_at(-share) * self.nu_m
    }
}
