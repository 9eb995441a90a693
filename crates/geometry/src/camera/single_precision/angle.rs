//! Lens models that are functions of the angle off the axis, in single precision.

use super::project::ProjectF32;
use crate::camera::fov::Fov;
use crate::camera::thin_prism::{ThinPrismCoefficients, ThinPrismFisheye};

/// Coefficients of the polynomial that interpolates `atan(√s)/√s` at the Chebyshev nodes of [0, 1],
/// lowest degree first; it is exact to 3·10⁻⁹.
const ARCTANGENT: [f32; 10] = [
    1.0,
    -0.333_332_78,
    0.199_980_75,
    -0.142_600_16,
    0.109_323_41,
    -0.083_497_25,
    0.057_089_556,
    -0.030_351_864,
    0.010_487_65,
    -0.001_701_170_1,
];

/// Smallest divisor.
const MIN_LENGTH: f32 = f32::MIN_POSITIVE;

/// `θ/ρ`, the angle `θ = atan2(ρ, z)` over the distance ρ from the axis, whose square is given.
#[inline(always)]
fn angle_per_distance(square: f32, z: f32) -> f32 {
    let (rho, depth) = (square.sqrt(), z.abs());
    let large = rho.max(depth).max(MIN_LENGTH);
    let ratio = rho.min(depth) / large;
    let s = ratio * ratio;
    let mut factor = ARCTANGENT[ARCTANGENT.len() - 1];
    for c in ARCTANGENT[..ARCTANGENT.len() - 1].iter().rev() {
        factor = factor * s + c;
    }
    let is_near_axis = rho < depth;
    // atan(min/max) is the angle from the axis, from the plane across it, or from the axis
    // behind.
    let acute = ratio * factor;
    let beside = std::f32::consts::FRAC_PI_2 - acute.copysign(z);
    let angle = if is_near_axis {
        std::f32::consts::PI - acute
    } else {
        beside
    };
    let far_from_axis = angle / rho.max(MIN_LENGTH);
    if is_near_axis & (z > 0.0) {
        factor / large
    } else {
        far_from_axis
    }
}

/// Field-of-view projection ([`Fov`]).
#[derive(Clone, Copy, Debug)]
pub struct FovF32 {
    stretch: f32,
    /// `2 tan(ω/2)/ω`.
    scale: f32,
    min_cos: f32,
}

impl FovF32 {
    pub(super) fn new(lens: &Fov) -> Self {
        Self {
            stretch: lens.stretch() as f32,
            scale: lens.axis_scale() as f32,
            // The cosine of 90° is not 0 after rounding.
            min_cos: lens.max_angle_rad().cos().max(1e-9) as f32,
        }
    }
}

impl ProjectF32 for FovF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let square = x * x + y * y;
        let factor = self.scale * angle_per_distance(self.stretch * self.stretch * square, z);
        let shown = z > self.min_cos * (square + z * z).sqrt();
        (x * factor, y * factor, shown)
    }
}

/// Kannala–Brandt projection with tangential and thin-prism distortion ([`ThinPrismFisheye`]).
#[derive(Clone, Copy, Debug)]
pub struct ThinPrismFisheyeF32 {
    k: [f32; 4],
    p: [f32; 2],
    s: [f32; 2],
    /// Square of the largest angle.
    limit: f32,
    min_cos: f32,
}

impl ThinPrismFisheyeF32 {
    pub(super) fn new(lens: &ThinPrismFisheye) -> Self {
        let ThinPrismCoefficients { k, p, s } = *lens.coefficients();
        let limit_rad = lens.field_of_view().limit_rad();
        Self {
            k: k.map(|k| k as f32),
            p: p.map(|p| p as f32),
            s: s.map(|s| s as f32),
            limit: (limit_rad * limit_rad) as f32,
            min_cos: limit_rad.cos() as f32,
        }
    }
}

impl ProjectF32 for ThinPrismFisheyeF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let ([k1, k2, k3, k4], [p1, p2], [sx1, sy1]) = (self.k, self.p, self.s);
        let across = x * x + y * y;
        let scale = angle_per_distance(across, z);
        let (a, b) = (x * scale, y * scale);
        let square = (a * a + b * b).min(self.limit);
        let factor = 1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4)));
        let mixed = 2.0 * a * b;
        (
            a * factor + p1 * mixed + p2 * (square + 2.0 * a * a) + sx1 * square,
            b * factor + p2 * mixed + p1 * (square + 2.0 * b * b) + sy1 * square,
            z > self.min_cos * (across + z * z).sqrt(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_exact_to_rounding_all_around() {
        for k in 0..=3600u32 {
            let theta = f64::from(k) / 3600.0 * std::f64::consts::PI;
            let (rho, z) = (theta.sin() as f32 * 3.0, theta.cos() as f32 * 3.0);
            let exact = f64::from(rho).atan2(f64::from(z));
            let ratio = f64::from(angle_per_distance(rho * rho, z));
            let found = ratio * f64::from(rho);
            assert!(
                (found - exact).abs() < 4e-7 * (1.0 + exact),
                "{theta}: {found}"
            );
        }
        assert_eq!(angle_per_distance(0.0, 2.0), 0.5);
    }
}
