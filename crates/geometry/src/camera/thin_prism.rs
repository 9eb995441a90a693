//! The Kannala–Brandt fisheye with tangential and thin-prism distortion.

use super::field_of_view::FieldOfView;
use super::lens_error::LensParameterError;
use super::planar_inverse::{invert_planar, planar_limit};
use super::radial::{project_radial, radial_jacobian, radial_ray};
use crate::numerics::monotone::invert_monotone;
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use std::f64::consts::PI;

/// Coefficients of a [`ThinPrismFisheye`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ThinPrismCoefficients {
    /// k1 to k4: radial.
    pub k: [f64; 4],
    /// p1, p2: tangential.
    pub p: [f64; 2],
    /// sx1, sy1: thin prism.
    pub s: [f64; 2],
}

/// Fisheye projection with distortion in the plane: a point at the angle θ off the axis has the
/// equidistant image point `q = (a, b) = θ (x, y)/√(x² + y²)` and appears at
///
/// `p_d = f q + (2 p1 a b + p2 (θ² + 2a²) + sx1 θ², p1 (θ² + 2b²) + 2 p2 a b + sy1 θ²)`,
/// `f = 1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸`.
///
/// Without the tangential and thin-prism part it is [`super::KannalaBrandt`]. The field of view is
/// limited to the angle within which the distortion is invertible (`det ∂p_d/∂q > 0` in all
/// directions).
///
/// Source: COLMAP's documentation, "Camera Models", `THIN_PRISM_FISHEYE`; J. Weng, P. Cohen, M.
/// Herniou, "Camera calibration with distortion models and accuracy evaluation", PAMI 14(10), 1992.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinPrismFisheye {
    coefficients: ThinPrismCoefficients,
    field_of_view: FieldOfView,
}

impl ThinPrismFisheye {
    /// Creates the lens and determines its limit.
    ///
    /// # Errors
    /// [`LensParameterError`] for a coefficient that is not finite.
    pub fn new(coefficients: ThinPrismCoefficients) -> Result<Self, LensParameterError> {
        let ThinPrismCoefficients { k, p, s } = coefficients;
        let names = ["k1", "k2", "k3", "k4", "p1", "p2", "sx1", "sy1"];
        let values = k.into_iter().chain(p).chain(s);
        LensParameterError::unless_finite(names.into_iter().zip(values))?;
        Ok(Self::with_coefficients(coefficients))
    }

    /// The lens with finite coefficients.
    fn with_coefficients(coefficients: ThinPrismCoefficients) -> Self {
        let mut lens = Self {
            coefficients,
            field_of_view: FieldOfView::up_to(PI),
        };
        let determinant = |q: &Vector2<f64>| lens.distortion_jacobian(q).determinant();
        let limit_rad = planar_limit(determinant, PI, lens.is_radial()).min(PI);
        lens.field_of_view = FieldOfView::up_to(limit_rad);
        lens
    }

    /// True without tangential and thin-prism distortion.
    fn is_radial(&self) -> bool {
        self.coefficients.p == [0.0; 2] && self.coefficients.s == [0.0; 2]
    }

    /// This lens, limited to `max_angle_rad` off its axis.
    pub fn limited_to(mut self, max_angle_rad: f64) -> Self {
        self.field_of_view = self.field_of_view.limited_to(max_angle_rad);
        self
    }

    /// The directions that it shows.
    pub fn field_of_view(&self) -> &FieldOfView {
        &self.field_of_view
    }

    /// The coefficients.
    pub fn coefficients(&self) -> &ThinPrismCoefficients {
        &self.coefficients
    }

    /// This lens with k1 and k2 replaced.
    pub fn with_k1_k2(&self, k1: f64, k2: f64) -> Self {
        let mut coefficients = self.coefficients;
        [coefficients.k[0], coefficients.k[1]] = [k1, k2];
        Self::with_coefficients(coefficients).limited_to(self.field_of_view.max_angle_rad())
    }

    /// The radial factor f and its derivative by θ².
    fn factor(&self, square: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.coefficients.k;
        let f = 1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4)));
        let slope = k1 + square * (2.0 * k2 + square * (3.0 * k3 + square * 4.0 * k4));
        (f, slope)
    }

    /// Distorts the equidistant image point q, regardless of the limit.
    fn distort(&self, q: &Vector2<f64>) -> Vector2<f64> {
        let ThinPrismCoefficients {
            p: [p1, p2],
            s: [sx1, sy1],
            ..
        } = self.coefficients;
        let (square, mixed) = (q.norm_squared(), 2.0 * q.x * q.y);
        let (f, _) = self.factor(square);
        Vector2::new(
            q.x * f + p1 * mixed + p2 * (square + 2.0 * q.x * q.x) + sx1 * square,
            q.y * f + p1 * (square + 2.0 * q.y * q.y) + p2 * mixed + sy1 * square,
        )
    }

    /// `∂p_d/∂q = f I + 2 f′ q qᵀ + 2 (p1 b + 3 p2 a, p1 a + p2 b; p1 a + p2 b, 3 p1 b + p2 a)
    /// + 2 (sx1, sy1) qᵀ`.
    fn distortion_jacobian(&self, q: &Vector2<f64>) -> Matrix2<f64> {
        let [p1, p2] = self.coefficients.p;
        let (f, slope) = self.factor(q.norm_squared());
        let mixed = p1 * q.x + p2 * q.y;
        let tangential = Matrix2::new(
            p1 * q.y + 3.0 * p2 * q.x,
            mixed,
            mixed,
            3.0 * p1 * q.y + p2 * q.x,
        );
        let prism = Vector2::from(self.coefficients.s) * q.transpose();
        Matrix2::identity() * f + (q * q.transpose() * slope + tangential + prism) * 2.0
    }

    /// Projects a point; None beyond the limit.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        project_radial(x_c, self.field_of_view.limit_rad(), 1.0, |theta| theta)
            .map(|q| self.distort(&q))
    }

    /// `∂p_d/∂x_c = ∂p_d/∂q ∂q/∂x_c`, the latter by [`radial_jacobian`].
    pub fn jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        let q = equidistant(x_c);
        self.distortion_jacobian(&q) * radial_jacobian(x_c, 1.0, |theta| (theta, 1.0))
    }

    /// `∂p_d/∂(k1, k2) = (θ² q, θ⁴ q)`.
    pub fn coefficient_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2<f64> {
        let q = equidistant(x_c);
        let square = q.norm_squared();
        Matrix2::from_columns(&[q * square, q * (square * square)])
    }

    /// Back-projects `p_d` to a unit vector; None beyond the limit.
    ///
    /// The radial part has one unknown ([`invert_monotone`]). Newton's method then removes the
    /// other distortion ([`invert_planar`]).
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        let target = p_d.norm();
        if target == 0.0 {
            return Some(Vector3::z());
        }
        let radial = |theta: f64| {
            let square = theta * theta;
            let (f, slope) = self.factor(square);
            (theta * f, f + 2.0 * square * slope)
        };
        let limit_rad = self.field_of_view.limit_rad();
        let theta = invert_monotone(radial, target, limit_rad);
        if self.is_radial() {
            return theta.map(|theta| radial_ray(p_d, theta));
        }
        // Without a radial solution the other part may still allow one.
        let start = theta.unwrap_or(0.9 * limit_rad.min(target));
        let q = invert_planar(
            p_d,
            p_d * (start.min(0.999 * limit_rad) / target),
            limit_rad * limit_rad,
            |q| self.distort(q),
            |q| self.distortion_jacobian(q),
        )?;
        Some(radial_ray(&q, q.norm()))
    }
}

/// The equidistant image point `θ (x, y)/√(x² + y²)` of a point anywhere.
fn equidistant(x_c: &Vector3<f64>) -> Vector2<f64> {
    project_radial(x_c, f64::INFINITY, 1.0, |theta| theta).unwrap_or_default()
}
