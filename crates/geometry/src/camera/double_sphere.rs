//! The double sphere model.

use super::field_of_view::FieldOfView;
use super::lens_error::LensParameterError;
use super::quotient::quotient_jacobian;
use super::sphere_share::{fold_share, lifted_depth};
use nalgebra::{Matrix2x3, RowVector3, Vector2, Vector3};

/// Projection through two unit spheres and a plane: `p_d = (x, y)/(α d₂ + (1 − α) k)` with
/// `k = ξ d₁ + z`, `d₁ = |x_c|`, `d₂ = √(x² + y² + k²)`.
///
/// A ray at the angle θ off the axis meets the second sphere, whose centre lies ξ behind that of
/// the first, at the angle φ with `tan φ = sin θ/(ξ + cos θ)`, and appears at the radius
/// `sin φ/(α + (1 − α) cos φ)`. That rises up to `cos φ = −w₁`, `w₁ = α/(1 − α)` for α ≤ ½ and
/// `(1 − α)/α` above, where
///
/// `cos θ = −ξ (1 − w₁²) − w₁ √(1 − ξ² (1 − w₁²))`,
///
/// and, for ξ > 1, up to `cos θ = −1/ξ`, where φ is largest. The field of view ends there
/// ([`FieldOfView::limit_rad`]). (The bound on z in the paper is that of another angle; it is the
/// same for ξ = 0.)
///
/// Source: V. Usenko, N. Demmel, D. Cremers, "The double sphere camera model", 3DV 2018.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleSphere {
    xi: f64,
    alpha: f64,
    field_of_view: FieldOfView,
}

impl DoubleSphere {
    /// Creates the lens with the distance ξ of the spheres and the share α of the second.
    ///
    /// # Errors
    /// [`LensParameterError`] unless ξ > −1 and 0 ≤ α ≤ 1.
    pub fn new(xi: f64, alpha: f64) -> Result<Self, LensParameterError> {
        let is_distance = xi.is_finite() && xi > -1.0;
        LensParameterError::unless(is_distance, "xi", xi, "be a number above -1")?;
        let is_share = (0.0..=1.0).contains(&alpha);
        LensParameterError::unless(is_share, "alpha", alpha, "lie between 0 and 1")?;
        let w = fold_share(alpha);
        let outside = 1.0 - w * w;
        let min_cos = if xi > 1.0 {
            -1.0 / xi
        } else {
            -xi * outside - w * (1.0 - xi * xi * outside).sqrt()
        };
        Ok(Self {
            xi,
            alpha,
            field_of_view: FieldOfView::down_to(min_cos),
        })
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

    /// ξ and α.
    pub fn parameters(&self) -> [f64; 2] {
        [self.xi, self.alpha]
    }

    /// Distance of a point at a small angle from the image's centre, per radian: `1/(1 + ξ)`.
    pub fn axis_scale(&self) -> f64 {
        1.0 / (1.0 + self.xi)
    }

    /// Projects a point; None beyond the limit.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        let is_shown = self.field_of_view.shows(x_c);
        let (denominator, _) = self.denominator(x_c);
        (is_shown && denominator > 0.0).then(|| x_c.xy() / denominator)
    }

    /// `∂p_d/∂x_c` ([`quotient_jacobian`]).
    pub fn jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        let (denominator, slope) = self.denominator(x_c);
        quotient_jacobian(&(x_c.xy() / denominator), denominator, &slope)
    }

    /// `D = α d₂ + (1 − α) k` and `∂D/∂x_c`, with `∂k = ξ x_cᵀ/d₁ + (0, 0, 1)` and
    /// `∂d₂ = ((x, y, 0) + k ∂k)/d₂`.
    fn denominator(&self, x_c: &Vector3<f64>) -> (f64, RowVector3<f64>) {
        let d1 = x_c.norm();
        let k = self.xi * d1 + x_c.z;
        let d2 = (x_c.xy().norm_squared() + k * k).sqrt();
        let by_k = x_c.transpose() * (self.xi / d1) + Vector3::z().transpose();
        let by_d2 = (RowVector3::new(x_c.x, x_c.y, 0.0) + by_k * k) / d2;
        let value = self.alpha * d2 + (1.0 - self.alpha) * k;
        (value, by_d2 * self.alpha + by_k * (1.0 - self.alpha))
    }

    /// Back-projects `p_d` to a unit vector; None beyond the limit.
    ///
    /// With `r = |p_d|`, `m = (1 − α² r²)/(α √(1 − (2α − 1) r²) + 1 − α)`:
    /// `(m ξ + √(m² + (1 − ξ²) r²))/(m² + r²) (p_d, m) − (0, 0, ξ)`.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        let (xi, alpha, square) = (self.xi, self.alpha, p_d.norm_squared());
        let m = lifted_depth(alpha, square);
        let far = m * m + square;
        let scale = (m * xi + (m * m + (1.0 - xi * xi) * square).sqrt()) / far;
        let ray = (p_d * scale).push(m * scale - xi);
        // A root of a negative number is not shown, either.
        self.field_of_view.shows_ray(&ray).then_some(ray)
    }
}
