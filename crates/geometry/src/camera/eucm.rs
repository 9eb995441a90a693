//! The enhanced unified camera model.

use super::field_of_view::FieldOfView;
use super::lens_error::LensParameterError;
use super::quotient::quotient_jacobian;
use super::sphere_share::{fold_share, lifted_depth};
use nalgebra::{Matrix2x3, RowVector3, Vector2, Vector3};

/// Projection through an ellipsoid and a plane: `p_d = (x, y)/(α d + (1 − α) z)`,
/// `d = √(β (x² + y²) + z²)`.
///
/// The radius rises up to `z = −w d`, `w = α/(1 − α)` for α ≤ ½ and `(1 − α)/α` above: the field of
/// view ends at the angle `atan2(√((1 − w²)/β), −w)` ([`FieldOfView::limit_rad`]).
///
/// Source: B. Khomutenko, G. Garcia, P. Martinet, "An enhanced unified camera model", RA-L 1(1),
/// 2016; the field of view: V. Usenko, N. Demmel, D. Cremers, "The double sphere camera model", 3DV
/// 2018.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eucm {
    alpha: f64,
    beta: f64,
    field_of_view: FieldOfView,
}

impl Eucm {
    /// Creates the lens with the share α of the ellipsoid and its stretch β.
    ///
    /// # Errors
    /// [`LensParameterError`] unless 0 ≤ α ≤ 1 and β > 0.
    pub fn new(alpha: f64, beta: f64) -> Result<Self, LensParameterError> {
        let is_share = (0.0..=1.0).contains(&alpha);
        LensParameterError::unless(is_share, "alpha", alpha, "lie between 0 and 1")?;
        let is_stretch = beta.is_finite() && beta > 0.0;
        LensParameterError::unless(is_stretch, "beta", beta, "be a positive number")?;
        let w = fold_share(alpha);
        let limit_rad = ((1.0 - w * w) / beta).sqrt().atan2(-w);
        Ok(Self {
            alpha,
            beta,
            field_of_view: FieldOfView::up_to(limit_rad),
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

    /// α and β.
    pub fn parameters(&self) -> [f64; 2] {
        [self.alpha, self.beta]
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

    /// `D = α d + (1 − α) z` and `∂D/∂x_c = α (β x, β y, z)/d + (0, 0, 1 − α)`.
    fn denominator(&self, x_c: &Vector3<f64>) -> (f64, RowVector3<f64>) {
        let (alpha, beta) = (self.alpha, self.beta);
        let d = (beta * x_c.xy().norm_squared() + x_c.z * x_c.z).sqrt();
        let by_d = RowVector3::new(beta * x_c.x, beta * x_c.y, x_c.z) / d;
        let value = alpha * d + (1.0 - alpha) * x_c.z;
        (
            value,
            by_d * alpha + Vector3::z().transpose() * (1.0 - alpha),
        )
    }

    /// Back-projects `p_d` to a unit vector, `(p_d, m)/|(p_d, m)|` with `r = |p_d|`,
    /// `m = (1 − β α² r²)/(α √(1 − (2α − 1) β r²) + 1 − α)`; None beyond the limit.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        let (alpha, square) = (self.alpha, self.beta * p_d.norm_squared());
        let m = lifted_depth(alpha, square);
        let ray = p_d.push(m).normalize();
        // A root of a negative number is not shown, either.
        self.field_of_view.shows_ray(&ray).then_some(ray)
    }
}
