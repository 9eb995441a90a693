//! The Brown–Conrady lens model.

use super::planar_inverse::{invert_planar, planar_limit};
use crate::numerics::monotone::invert_monotone;
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::FRAC_PI_2;

/// Coefficients of a Brown–Conrady lens, in OpenCV's convention and names. The plain polynomial (4
/// or 5 coefficients) has `k4 = k5 = k6 = 0`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BrownCoefficients {
    /// k1 to k6: radial, k4 to k6 in the denominator.
    pub k: [f64; 6],
    /// p1, p2: tangential.
    pub p: [f64; 2],
}

/// Radial and tangential distortion: the undistorted point `p = (x, y) = (x_c/z_c, y_c/z_c)`
/// appears at
///
/// `p_d = f p + (2 p1 x y + p2 (q + 2x²), p1 (q + 2y²) + 2 p2 x y)`,
/// `f = (1 + k1 q + k2 q² + k3 q³)/(1 + k4 q + k5 q² + k6 q³)`, `q = |p|²`.
///
/// The field of view is limited to the radius within which the distortion is invertible
/// (`det ∂p_d/∂p > 0` in all directions; [`BrownConrady::limit`]).
///
/// Source: D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37(8), 1971;
/// the rational form: D. Claus and A. W. Fitzgibbon, "A rational function lens distortion model for
/// general cameras", CVPR 2005.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrownConrady {
    coefficients: BrownCoefficients,
    /// Largest angle off the axis to be used, radians.
    max_angle_rad: f64,
    /// Largest |p|², or infinity.
    limit: f64,
}

/// Largest radius |p| at which the limit is searched: 89.4° off the axis.
const MAX_RADIUS: f64 = 100.0;

impl BrownConrady {
    /// Creates the lens with these coefficients and determines its limit.
    pub fn new(coefficients: BrownCoefficients) -> Self {
        let mut lens = Self {
            coefficients,
            max_angle_rad: FRAC_PI_2,
            limit: f64::INFINITY,
        };
        if coefficients == BrownCoefficients::default() {
            return lens;
        }
        let determinant = |p: &Vector2<f64>| {
            let (f, _) = lens.factor(p.norm_squared());
            // Beyond a pole the factor is negative.
            if f > 0.0 {
                lens.jacobian(p).determinant()
            } else {
                -1.0
            }
        };
        let is_symmetric = coefficients.p == [0.0; 2];
        lens.limit = planar_limit(determinant, MAX_RADIUS, is_symmetric).powi(2);
        lens
    }

    /// A lens with k1 and k2 only.
    pub fn radial(k1: f64, k2: f64) -> Self {
        Self::new(BrownCoefficients {
            k: [k1, k2, 0.0, 0.0, 0.0, 0.0],
            p: [0.0; 2],
        })
    }

    /// This lens, limited to `max_angle_rad` off its axis.
    pub fn limited_to(mut self, max_angle_rad: f64) -> Self {
        if max_angle_rad < FRAC_PI_2 {
            self.max_angle_rad = max_angle_rad;
            self.limit = self.limit.min(max_angle_rad.tan().powi(2));
        }
        self
    }

    /// The largest angle off the axis to be used, radians; 90° if there is no limit.
    pub fn max_angle_rad(&self) -> f64 {
        self.max_angle_rad
    }

    /// The coefficients.
    pub fn coefficients(&self) -> &BrownCoefficients {
        &self.coefficients
    }

    /// True for a lens without distortion and without a limit of the field of view.
    pub fn is_distortion_free(&self) -> bool {
        self.coefficients == BrownCoefficients::default() && self.limit == f64::INFINITY
    }

    /// The limit of the field of view as `q = |p|²`; infinity if there is none.
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// The radial factor f and its derivative by q.
    fn factor(&self, q: f64) -> (f64, f64) {
        let [k1, k2, k3, k4, k5, k6] = self.coefficients.k;
        let above = 1.0 + q * (k1 + q * (k2 + q * k3));
        let below = 1.0 + q * (k4 + q * (k5 + q * k6));
        let above_slope = k1 + q * (2.0 * k2 + q * 3.0 * k3);
        let below_slope = k4 + q * (2.0 * k5 + q * 3.0 * k6);
        let f = above / below;
        (f, (above_slope - f * below_slope) / below)
    }

    /// Distorts the point `p`, regardless of the limit.
    pub fn distort(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let [p1, p2] = self.coefficients.p;
        let q = p.norm_squared();
        let (f, _) = self.factor(q);
        let (x, y) = (p.x, p.y);
        Vector2::new(
            x * f + 2.0 * p1 * x * y + p2 * (q + 2.0 * x * x),
            y * f + p1 * (q + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// `∂p_d/∂p = f I + 2 f′ p pᵀ + 2 (p1 y + 3 p2 x, p1 x + p2 y; p1 x + p2 y, 3 p1 y + p2 x)`.
    pub fn jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        let [p1, p2] = self.coefficients.p;
        let (f, slope) = self.factor(p.norm_squared());
        let (x, y) = (p.x, p.y);
        let mixed = p1 * x + p2 * y;
        let tangential = Matrix2::new(p1 * y + 3.0 * p2 * x, mixed, mixed, 3.0 * p1 * y + p2 * x);
        Matrix2::identity() * f + (p * p.transpose() * slope + tangential) * 2.0
    }

    /// `∂p_d/∂(k1, k2) = (q p, q² p)/(1 + k4 q + k5 q² + k6 q³)`.
    pub fn coefficient_jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        let [.., k4, k5, k6] = self.coefficients.k;
        let q = p.norm_squared();
        let below = 1.0 + q * (k4 + q * (k5 + q * k6));
        Matrix2::from_columns(&[p * (q / below), p * (q * q / below)])
    }

    /// Inverts the distortion of `p_d`; None if no point within the limit maps to it.
    ///
    /// The radial part has one unknown ([`invert_monotone`]). Newton's method then removes the
    /// tangential distortion ([`invert_planar`]).
    pub fn undistort(&self, p_d: &Vector2<f64>) -> Option<Vector2<f64>> {
        let target = p_d.norm();
        if self.is_distortion_free() || target == 0.0 {
            return Some(*p_d);
        }
        let end = self.limit.sqrt();
        let radial = |rho: f64| {
            let q = rho * rho;
            let (f, slope) = self.factor(q);
            (rho * f, f + 2.0 * q * slope)
        };
        let rho = invert_monotone(radial, target, end);
        if self.coefficients.p == [0.0; 2] {
            return rho.map(|rho| p_d * (rho / target));
        }
        // Without a radial solution the tangential part may still allow one.
        let start = rho.unwrap_or(0.9 * end.min(target)).min(0.999 * end);
        invert_planar(
            p_d,
            p_d * (start / target),
            self.limit,
            |p| self.distort(p),
            |p| self.jacobian(p),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn lens(k: [f64; 6], p: [f64; 2]) -> BrownConrady {
        BrownConrady::new(BrownCoefficients { k, p })
    }

    fn lenses() -> Vec<BrownConrady> {
        vec![
            BrownConrady::radial(-0.05, 0.0),
            BrownConrady::radial(0.1, 0.0),
            BrownConrady::radial(-0.28, 0.07),
            BrownConrady::radial(0.2, -0.1),
            BrownConrady::radial(0.0, 0.0),
            lens([-0.3, 0.1, -0.02, 0.0, 0.0, 0.0], [1e-3, -2e-3]),
            // Typical of OpenCV's calibrations of wide lenses.
            lens([4.1, 2.0, 0.1, 4.4, 3.1, 0.45], [-4e-4, 6e-4]),
            lens([0.0; 6], [0.01, 0.02]),
        ]
    }

    proptest! {
        #[test]
        fn undistorting_inverts_within_the_limit(
            which in 0usize..8, share in 0.0f64..0.98, turn in 0.0..TAU,
        ) {
            let lens = lenses()[which];
            let rho = lens.limit().sqrt().min(3.0) * share;
            let p = Vector2::new(turn.cos(), turn.sin()) * rho;
            let back = lens.undistort(&lens.distort(&p));
            let is_restored = back.is_some_and(|back| (back - p).norm() < 1e-9 * (1.0 + rho));
            prop_assert!(is_restored, "{lens:?} at {p}: {back:?}");
        }

        /// A solution lies within the limit and distorts to the given point.
        #[test]
        fn what_is_found_is_a_solution(which in 0usize..8, x in -5.0f64..5.0, y in -5.0f64..5.0) {
            let lens = lenses()[which];
            let p_d = Vector2::new(x, y);
            if let Some(p) = lens.undistort(&p_d) {
                prop_assert!(p.norm_squared() <= lens.limit() * (1.0 + 1e-12));
                prop_assert!((lens.distort(&p) - p_d).norm() < 1e-10 * (1.0 + p_d.norm()));
            }
        }

        #[test]
        fn jacobians_match_central_differences(
            which in 0usize..8, x in -0.6f64..0.6, y in -0.6f64..0.6,
        ) {
            let lens = lenses()[which];
            let (p, step) = (Vector2::new(x, y), 1e-6);
            let jacobian = lens.jacobian(&p);
            let by_coefficient = lens.coefficient_jacobian(&p);
            for axis in 0..2 {
                let mut delta = Vector2::zeros();
                delta[axis] = step;
                let difference = lens.distort(&(p + delta)) - lens.distort(&(p - delta));
                let numeric = difference / (2.0 * step);
                prop_assert!((numeric - jacobian.column(axis)).norm() < 1e-7);
                let moved = |amount: f64| {
                    let mut moved = *lens.coefficients();
                    moved.k[axis] += amount;
                    BrownConrady::new(moved).distort(&p)
                };
                let numeric = (moved(step) - moved(-step)) / (2.0 * step);
                prop_assert!((numeric - by_coefficient.column(axis)).norm() < 1e-7);
            }
        }
    }

    #[test]
    fn the_limit_is_where_the_picture_folds() {
        // ρ − 0.05 ρ³ rises up to q = 1/0.15.
        let lens = BrownConrady::radial(-0.05, 0.0);
        assert!((lens.limit() - 1.0 / 0.15).abs() < 1e-9);
        assert_eq!(BrownConrady::radial(0.1, 0.0).limit(), f64::INFINITY);
        let end = lens.limit().sqrt();
        let farthest = lens.distort(&Vector2::new(end, 0.0));
        assert!(lens.undistort(&(farthest * 0.999)).is_some());
        assert!(lens.undistort(&(farthest * 1.001)).is_none());
        // A pole of the rational form is a limit, too.
        let pole = BrownConrady::new(BrownCoefficients {
            k: [0.0, 0.0, 0.0, -0.25, 0.0, 0.0],
            p: [0.0; 2],
        });
        assert!(pole.limit() <= 4.0);
    }
}
