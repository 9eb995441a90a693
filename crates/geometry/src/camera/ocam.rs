//! The polynomial model of OCamCalib, for omnidirectional cameras.

use super::field_of_view::FieldOfView;
use super::lens_error::LensParameterError;
use super::radial::{project_radial, radial_jacobian, radial_ray};
use crate::numerics::monotone::{invert_monotone, monotone_limit};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use std::f64::consts::PI;

/// Number of coefficients of the polynomial, from the square on.
pub const OCAM_COEFFICIENTS: usize = 8;
/// Largest radius, in focal lengths, up to which the polynomial is used.
const MAX_RADIUS: f64 = 100.0;
const COEFFICIENT_NAMES: [&str; OCAM_COEFFICIENTS] =
    ["a2", "a3", "a4", "a5", "a6", "a7", "a8", "a9"];

/// Back-projection by a polynomial: the image point m = (a, b), in focal lengths from the centre of
/// distortion, shows the ray `(a, b, g(ρ))`, `ρ = |m|`, `g = 1 + a2 ρ² + a3 ρ³ + … + a9 ρ⁹`. The
/// sensor shears the image: `p_d = (a + e b, d a + c b)`.
///
/// The field of view ends where the angle `θ = atan2(ρ, g)` stops rising, at `g = ρ g′`. The
/// projection solves for ρ; the inverse polynomial of a calibration file only approximates it and
/// is not needed.
///
/// In a file of OCamCalib, g is in pixels with the other sign, `f = −a0` is the focal length, x is
/// down, y to the right and z backwards.
///
/// Source: D. Scaramuzza, A. Martinelli, R. Siegwart, "A toolbox for easily calibrating
/// omnidirectional cameras", IROS 2006.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ocam {
    /// a2 to a9.
    polynomial: [f64; OCAM_COEFFICIENTS],
    /// c, d, e.
    affine: [f64; 3],
    field_of_view: FieldOfView,
    /// The radius ρ and the angle at which θ stops rising.
    end: (f64, f64),
}

impl Ocam {
    /// Creates the lens with a2 to a9 and c, d, e, and determines its limit.
    ///
    /// # Errors
    /// [`LensParameterError`] for a coefficient that is not finite, and for an affine part that
    /// mirrors the image (c ≤ d e).
    pub fn new(
        polynomial: [f64; OCAM_COEFFICIENTS],
        affine: [f64; 3],
    ) -> Result<Self, LensParameterError> {
        LensParameterError::unless_finite(COEFFICIENT_NAMES.into_iter().zip(polynomial))?;
        LensParameterError::unless_finite(["c", "d", "e"].into_iter().zip(affine))?;
        let [c, d, e] = affine;
        LensParameterError::unless(c > d * e, "c", c, "be more than d e (near 1)")?;
        let mut lens = Self {
            polynomial,
            affine,
            field_of_view: FieldOfView::up_to(PI),
            end: (0.0, 0.0),
        };
        let rises = |rho: f64| {
            let (g, slope) = lens.depth(rho);
            g - rho * slope
        };
        let end = monotone_limit(rises, MAX_RADIUS).min(MAX_RADIUS);
        lens.end = (end, lens.angle(end).0);
        lens.field_of_view = FieldOfView::up_to(lens.end.1);
        Ok(lens)
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

    /// The coefficients a2 to a9.
    pub fn polynomial(&self) -> &[f64; OCAM_COEFFICIENTS] {
        &self.polynomial
    }

    /// c, d, e.
    pub fn affine(&self) -> [f64; 3] {
        self.affine
    }

    /// g and its derivative at the radius ρ.
    fn depth(&self, rho: f64) -> (f64, f64) {
        let (mut g, mut slope) = (0.0, 0.0);
        for a in self.polynomial.iter().rev() {
            slope = slope * rho + g;
            g = g * rho + a;
        }
        // So far the polynomial is g = a2 + a3 ρ + …, which stands before ρ².
        (1.0 + rho * rho * g, rho * (2.0 * g + rho * slope))
    }

    /// The angle θ at the radius ρ and its derivative `(g − ρ g′)/(ρ² + g²)`.
    fn angle(&self, rho: f64) -> (f64, f64) {
        let (g, slope) = self.depth(rho);
        (rho.atan2(g), (g - rho * slope) / (rho * rho + g * g))
    }

    /// The radius ρ at the angle θ within the limit and its derivative.
    pub fn radius(&self, theta: f64) -> (f64, f64) {
        let (end, end_rad) = self.end;
        // Rounding of the angle at the end.
        let rho = invert_monotone(|rho| self.angle(rho), theta.min(end_rad), end).unwrap_or(end);
        (rho, 1.0 / self.angle(rho).1)
    }

    /// The shear `(1, e; d, c)`.
    fn shear(&self) -> Matrix2<f64> {
        let [c, d, e] = self.affine;
        Matrix2::new(1.0, e, d, c)
    }

    /// Projects a point; None beyond the limit.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        let m = project_radial(x_c, self.field_of_view.limit_rad(), 1.0, |theta| {
            self.radius(theta).0
        })?;
        Some(self.shear() * m)
    }

    /// `∂p_d/∂x_c = (1, e; d, c) ∂m/∂x_c`, the latter by [`radial_jacobian`].
    pub fn jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        self.shear() * radial_jacobian(x_c, 1.0, |theta| self.radius(theta))
    }

    /// Back-projects `p_d` to a unit vector; None beyond the limit.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        let m = self.shear().try_inverse()? * p_d;
        let rho = m.norm();
        let theta = self.angle(rho).0;
        (rho < self.end.0 && theta < self.field_of_view.limit_rad()).then(|| radial_ray(&m, theta))
    }
}
