//! Rolling shutter: the camera moves while the rows of a picture are read, so every row has a pose
//! of its own.

use nalgebra::{Rotation3, Vector3};

/// How a camera moves while as many rows are read as its picture has, in its own coordinates at the
/// time of the middle row: steadily, by the rotation ω (radians) and the shift ν (metres).
///
/// Row v of a picture of H rows is read at the share `τ = (v − (H − 1)/2)/H` of that time, from −½
/// to ½. The camera has then turned by `Exp(ω τ)` and moved by `ν τ`: a point x_c of the middle
/// row's coordinates lies at
///
/// `x_c(τ) = Exp(−ω τ) (x_c − ν τ)`
///
/// in the row's own. Shares are those of any halved picture, too ([`super::Camera::at_level`]);
/// where an odd number of rows was halved, to within half a row.
///
/// Source: M. Meingast, C. Geyer, S. Sastry, "Geometric models of rolling-shutter cameras", OMNIVIS 2005.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sweep {
    /// ω, radians.
    pub omega_rad: Vector3<f64>,
    /// ν, metres.
    pub nu_m: Vector3<f64>,
}

/// The largest share: rows farther than half a picture's height beyond its border are taken as if
/// they were read there.
pub(super) const MAX_SHARE: f64 = 1.0;

impl Sweep {
    /// True for a global shutter, or a camera that stands still.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The motion during `factor` times the time.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            omega_rad: self.omega_rad * factor,
            nu_m: self.nu_m * factor,
        }
    }

    /// `Exp(ω τ)`: from the coordinates of the row read at the share τ to the middle row's.
    pub(super) fn rotation_at(&self, share: f64) -> Rotation3<f64> {
        Rotation3::new(self.omega_rad * share)
    }

    /// `x_c(τ)`.
    pub(super) fn point_at(&self, x_c: &Vector3<f64>, share: f64) -> Vector3<f64> {
        self.rotation_at(-share) * (x_c - self.nu_m * share)
    }

    /// `∂x_c(τ)/∂τ = −ω × x_c(τ) − Exp(−ω τ) ν` of a point that lies at `at` in the row's
    /// coordinates.
    pub(super) fn point_rate(&self, at: &Vector3<f64>, share: f64) -> Vector3<f64> {
        -self.omega_rad.cross(at) - self.rotation_at(-share) * self.nu_m
    }
}
