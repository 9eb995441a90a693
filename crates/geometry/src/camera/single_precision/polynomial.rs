//! The polynomial model of OCamCalib in single precision.

use super::chebyshev::{POLYNOMIAL_DEGREE, interpolate};
use super::project::ProjectF32;
use crate::camera::ocam::{OCAM_COEFFICIENTS, Ocam};

/// Largest angle off the axis, radians (170°): nearer to 180°, `cos θ` does not resolve the angle.
const MAX_ANGLE_RAD: f64 = 2.967;
/// Newton steps from the interpolated radius.
const NEWTON_STEPS: usize = 2;
/// Smallest slope that Newton's method divides by; where the field of view ends it is 0.
const MIN_SLOPE: f32 = 1e-2;

/// Projection by the inverse of a polynomial ([`Ocam`]).
///
/// `H = ρ (1 + cos θ)/sin θ` is interpolated at Chebyshev nodes of `cos θ` over the field of view;
/// Newton's method for `G = ρ/sin θ`, the root of `G cos θ = g(G sin θ)`, removes the error of the
/// interpolation. Points beyond 170° off the axis count as outside.
#[derive(Clone, Copy, Debug)]
pub struct OcamF32 {
    /// a2 to a9.
    polynomial: [f32; OCAM_COEFFICIENTS],
    /// c, d, e.
    affine: [f32; 3],
    /// Coefficients of H in `t = cos θ · scale + offset ∈ [−1, 1]`, lowest degree first.
    h: [f32; POLYNOMIAL_DEGREE + 1],
    scale: f32,
    offset: f32,
    min_cos: f32,
}

impl OcamF32 {
    pub(super) fn new(lens: &Ocam) -> Self {
        let min_cos = lens.field_of_view().limit_rad().min(MAX_ANGLE_RAD).cos();
        let (middle, half) = (0.5 * (1.0 + min_cos), 0.5 * (1.0 - min_cos));
        let h = interpolate(|t| {
            let cos = (middle + half * t).min(1.0);
            let theta = cos.acos();
            if theta < 1e-6 {
                2.0
            } else {
                lens.radius(theta).0 * (1.0 + cos) / theta.sin()
            }
        });
        Self {
            polynomial: lens.polynomial().map(|a| a as f32),
            affine: lens.affine().map(|a| a as f32),
            h: h.map(|c| c as f32),
            scale: (1.0 / half) as f32,
            offset: (-middle / half) as f32,
            min_cos: min_cos as f32,
        }
    }

    /// g and its derivative at the radius ρ.
    #[inline(always)]
    fn depth(self, rho: f32) -> (f32, f32) {
        let (mut g, mut slope) = (0.0, 0.0);
        for a in self.polynomial.iter().rev() {
            slope = slope * rho + g;
            g = g * rho + a;
        }
        (1.0 + rho * rho * g, rho * (2.0 * g + rho * slope))
    }
}

impl ProjectF32 for OcamF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        let exact = z * inverse;
        let cos = exact.max(self.min_cos).min(1.0);
        let sin = (1.0 - cos * cos).sqrt();
        let t = (cos * self.scale + self.offset).min(1.0);
        let mut h = self.h[POLYNOMIAL_DEGREE];
        for c in self.h[..POLYNOMIAL_DEGREE].iter().rev() {
            h = h * t + c;
        }
        let mut stretch = h / (1.0 + cos);
        for _ in 0..NEWTON_STEPS {
            let (g, slope) = self.depth(stretch * sin);
            stretch -= (stretch * cos - g) / (cos - sin * slope).max(MIN_SLOPE);
        }
        let [c, d, e] = self.affine;
        let (a, b) = (x * inverse * stretch, y * inverse * stretch);
        (a + e * b, d * a + c * b, exact > self.min_cos)
    }
}
