//! Perspective lens models in single precision.

use super::project::ProjectF32;
use crate::camera::brown_conrady::BrownConrady;

/// Pinhole projection `(x/z, y/z)`.
#[derive(Clone, Copy, Debug)]
pub struct PinholeF32;

impl ProjectF32 for PinholeF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / z;
        (x * inverse, y * inverse, z > 0.0)
    }
}

/// Brown–Conrady projection: radial and tangential distortion.
#[derive(Clone, Copy, Debug)]
pub struct BrownConradyF32 {
    k: [f32; 6],
    p: [f32; 2],
    limit: f32,
}

impl BrownConradyF32 {
    pub(super) fn new(lens: &BrownConrady) -> Self {
        let coefficients = lens.coefficients();
        Self {
            k: coefficients.k.map(|k| k as f32),
            p: coefficients.p.map(|p| p as f32),
            limit: lens.limit() as f32,
        }
    }

    /// Distorts the point (x, y); the flag is true within the limit.
    #[inline(always)]
    pub(super) fn distort(self, x: f32, y: f32) -> (f32, f32, bool) {
        let [k1, k2, k3, k4, k5, k6] = self.k;
        let [p1, p2] = self.p;
        let square = x * x + y * y;
        let q = square.min(self.limit);
        let factor = (1.0 + q * (k1 + q * (k2 + q * k3))) / (1.0 + q * (k4 + q * (k5 + q * k6)));
        let mixed = 2.0 * x * y;
        (
            x * factor + p1 * mixed + p2 * (q + 2.0 * x * x),
            y * factor + p2 * mixed + p1 * (q + 2.0 * y * y),
            square < self.limit,
        )
    }
}

impl ProjectF32 for BrownConradyF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / z;
        let (x, y, shown) = self.distort(x * inverse, y * inverse);
        (x, y, (z > 0.0) & shown)
    }
}
