//! The Kannala–Brandt fisheye in single precision.

use super::chebyshev::{POLYNOMIAL_DEGREE, interpolate};
use super::project::ProjectF32;
use std::f64::consts::PI;

/// Largest angle off the axis that the polynomial covers: nearer to 180°, `θ_d/sin θ` diverges.
const MAX_ANGLE_RAD: f64 = 0.75 * PI;

/// Kannala–Brandt projection `p_d = G(cos θ) (x, y)/|x_c|` with `G = θ_d/sin θ`, which is smooth in
/// `cos θ` as far as 180°.
///
/// G is interpolated at Chebyshev nodes over the lens's field of view, to about the rounding of
/// single precision up to 120° off the axis. Points beyond 135° count as outside.
#[derive(Clone, Copy, Debug)]
pub struct KannalaBrandtF32 {
    /// Coefficients of G in `t = cos θ · scale + offset ∈ [−1, 1]`, lowest degree first.
    g: [f32; POLYNOMIAL_DEGREE + 1],
    scale: f32,
    offset: f32,
    min_cos: f32,
}

impl KannalaBrandtF32 {
    /// Approximates θ_d = `radius(θ)` up to the angle `limit_rad`.
    pub(super) fn new(radius: impl Fn(f64) -> f64, limit_rad: f64) -> Self {
        let min_cos = limit_rad.min(MAX_ANGLE_RAD).cos();
        let (middle, half) = (0.5 * (1.0 + min_cos), 0.5 * (1.0 - min_cos));
        let g = interpolate(|t| {
            let theta = (middle + half * t).min(1.0).acos();
            if theta < 1e-6 {
                1.0
            } else {
                radius(theta) / theta.sin()
            }
        });
        Self {
            g: g.map(|c| c as f32),
            scale: (1.0 / half) as f32,
            offset: (-middle / half) as f32,
            min_cos: min_cos as f32,
        }
    }
}

impl ProjectF32 for KannalaBrandtF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        let cos = z * inverse;
        let t = (cos.max(self.min_cos) * self.scale + self.offset).min(1.0);
        let mut g = self.g[POLYNOMIAL_DEGREE];
        for c in self.g[..POLYNOMIAL_DEGREE].iter().rev() {
            g = g * t + c;
        }
        let stretch = g * inverse;
        (x * stretch, y * stretch, cos > self.min_cos)
    }
}
