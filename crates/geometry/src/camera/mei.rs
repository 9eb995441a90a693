//! The unified model of Mei and Rives, for omnidirectional cameras.

use super::brown_conrady::{BrownCoefficients, BrownConrady};
use super::field_of_view::FieldOfView;
use super::lens_error::LensParameterError;
use super::quotient::quotient_jacobian;
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

/// Projection through a unit sphere with radial and tangential distortion:
/// `p = (x, y)/(z + ξ |x_c|)` is distorted as by [`BrownConrady`] with k1, k2, p1, p2.
///
/// A ray at the angle θ off the axis is shown while `sin θ/(cos θ + ξ)` rises, up to
/// `cos θ = −ξ` for ξ ≤ 1 and `cos θ = −1/ξ` above, and while the distortion is invertible
/// ([`BrownConrady::limit`]). OpenCV calls the model `omnidir`, Kalibr `omni`, camodocal `MEI`.
///
/// Source: C. Mei, P. Rives, "Single view point omnidirectional camera calibration from planar
/// grids", ICRA 2007.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mei {
    xi: f64,
    distortion: BrownConrady,
    field_of_view: FieldOfView,
}

impl Mei {
    /// Creates the lens with ξ and the coefficients k1, k2, p1, p2, and determines its limit.
    ///
    /// # Errors
    /// [`LensParameterError`] unless ξ > −1 and the coefficients are finite.
    pub fn new(xi: f64, [k1, k2]: [f64; 2], p: [f64; 2]) -> Result<Self, LensParameterError> {
        let is_distance = xi.is_finite() && xi > -1.0;
        LensParameterError::unless(is_distance, "xi", xi, "be a number above -1")?;
        let coefficients = [("k1", k1), ("k2", k2), ("p1", p[0]), ("p2", p[1])];
        LensParameterError::unless_finite(coefficients)?;
        Ok(Self::with_distortion(xi, [k1, k2], p))
    }

    /// The lens with parameters that are in their ranges.
    fn with_distortion(xi: f64, [k1, k2]: [f64; 2], p: [f64; 2]) -> Self {
        let distortion = BrownConrady::new(BrownCoefficients {
            k: [k1, k2, 0.0, 0.0, 0.0, 0.0],
            p,
        });
        let mirror_cos = if xi > 1.0 { -1.0 / xi } else { -xi };
        let farthest = lifted(xi, &Vector2::new(distortion.limit().sqrt(), 0.0));
        let distortion_cos = farthest.map_or(-1.0, |ray| ray.z);
        let min_cos = mirror_cos.max(distortion_cos);
        Self {
            xi,
            distortion,
            field_of_view: FieldOfView::down_to(min_cos),
        }
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

    /// ξ.
    pub fn xi(&self) -> f64 {
        self.xi
    }

    /// The distortion, with its own limit.
    pub fn distortion(&self) -> &BrownConrady {
        &self.distortion
    }

    /// k1 and k2.
    pub fn k(&self) -> [f64; 2] {
        let [k1, k2, ..] = self.distortion.coefficients().k;
        [k1, k2]
    }

    /// p1 and p2.
    pub fn p(&self) -> [f64; 2] {
        self.distortion.coefficients().p
    }

    /// This lens with k1 and k2 replaced.
    pub fn with_k(&self, k: [f64; 2]) -> Self {
        Self::with_distortion(self.xi, k, self.p()).limited_to(self.field_of_view.max_angle_rad())
    }

    /// Distance of a point at a small angle from the image's centre, per radian: `1/(1 + ξ)`.
    pub fn axis_scale(&self) -> f64 {
        1.0 / (1.0 + self.xi)
    }

    /// Projects a point; None beyond the limit.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        let is_shown = self.field_of_view.shows(x_c);
        is_shown.then(|| self.distortion.distort(&self.undistorted(x_c)))
    }

    /// `p = (x, y)/(z + ξ |x_c|)`.
    fn undistorted(&self, x_c: &Vector3<f64>) -> Vector2<f64> {
        x_c.xy() / (x_c.z + self.xi * x_c.norm())
    }

    /// `∂p_d/∂x_c = ∂p_d/∂p ∂p/∂x_c`, the latter by [`quotient_jacobian`] with
    /// `∂D/∂x_c = (0, 0, 1) + ξ x_cᵀ/|x_c|`.
    pub fn jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        let distance = x_c.norm();
        let denominator = x_c.z + self.xi * distance;
        let p = x_c.xy() / denominator;
        let slope = Vector3::z().transpose() + x_c.transpose() * (self.xi / distance);
        self.distortion.jacobian(&p) * quotient_jacobian(&p, denominator, &slope)
    }

    /// `∂p_d/∂(k1, k2)` ([`BrownConrady::coefficient_jacobian`]).
    pub fn coefficient_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2<f64> {
        self.distortion.coefficient_jacobian(&self.undistorted(x_c))
    }

    /// Back-projects `p_d` to a unit vector; None beyond the limit.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        let p = self.distortion.undistort(p_d)?;
        lifted(self.xi, &p).filter(|ray| self.field_of_view.shows_ray(ray))
    }
}

/// The point of the unit sphere that appears at p without distortion, `η (p, 1) − (0, 0, ξ)` with
/// `η = (ξ + √(1 + (1 − ξ²) r²))/(1 + r²)`, `r = |p|`; None if no ray leads there.
fn lifted(xi: f64, p: &Vector2<f64>) -> Option<Vector3<f64>> {
    let square = p.norm_squared();
    let root = (1.0 + (1.0 - xi * xi) * square).sqrt();
    let eta = (xi + root) / (1.0 + square);
    // A root of a negative number is no ray.
    eta.is_finite().then(|| (p * eta).push(eta - xi))
}
