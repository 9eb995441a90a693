//! The field-of-view model.

use super::lens_error::LensParameterError;
use super::radial::{project_radial, radial_jacobian, radial_ray};
use nalgebra::{Matrix2x3, Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Fisheye with one coefficient: a point at the angle θ off the axis appears at the radius
/// `r_d = atan(2 tan(ω/2) tan θ)/ω`, in its own direction.
///
/// The model has no points beside or behind the camera: its field of view ends at 90°.
///
/// Source: F. Devernay, O. Faugeras, "Straight lines have to be straight", Machine Vision and
/// Applications 13(1), 2001.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fov {
    omega: f64,
    /// `2 tan(ω/2)`.
    stretch: f64,
    /// Largest angle off the axis to be used, radians.
    max_angle_rad: f64,
}

impl Fov {
    /// Creates the lens with the coefficient ω, radians.
    ///
    /// # Errors
    /// [`LensParameterError`] unless 0 < ω < π.
    pub fn new(omega: f64) -> Result<Self, LensParameterError> {
        let is_angle = omega > 0.0 && omega < PI;
        let rule = "be above 0 and below 3.14159 (radians)";
        LensParameterError::unless(is_angle, "omega", omega, rule)?;
        Ok(Self {
            omega,
            stretch: 2.0 * (0.5 * omega).tan(),
            max_angle_rad: FRAC_PI_2,
        })
    }

    /// This lens, limited to `max_angle_rad` off its axis.
    pub fn limited_to(mut self, max_angle_rad: f64) -> Self {
        self.max_angle_rad = max_angle_rad.min(FRAC_PI_2);
        self
    }

    /// The largest angle off the axis to be used, which is the limit of the field of view, radians;
    /// 90° if there is no other limit.
    pub fn max_angle_rad(&self) -> f64 {
        self.max_angle_rad
    }

    /// The coefficient ω, radians.
    pub fn omega(&self) -> f64 {
        self.omega
    }

    /// `2 tan(ω/2)`.
    pub fn stretch(&self) -> f64 {
        self.stretch
    }

    /// Distance of a point at a small angle from the image's centre, per radian: `2 tan(ω/2)/ω`.
    pub fn axis_scale(&self) -> f64 {
        self.stretch / self.omega
    }

    /// The radius r_d at the angle θ and its derivative `2 tan(ω/2)/(ω (cos² θ + 4 tan²(ω/2)
    /// sin² θ))`.
    fn radius(&self, theta: f64) -> (f64, f64) {
        let (sin, cos) = theta.sin_cos();
        let across = self.stretch * sin;
        let slope = self.stretch / (self.omega * (cos * cos + across * across));
        (across.atan2(cos) / self.omega, slope)
    }

    /// Projects a point; None beyond the limit.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        project_radial(x_c, self.max_angle_rad, self.axis_scale(), |theta| {
            self.radius(theta).0
        })
    }

    /// `∂p_d/∂x_c` ([`radial_jacobian`]).
    pub fn jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        radial_jacobian(x_c, self.axis_scale(), |theta| self.radius(theta))
    }

    /// Back-projects `p_d` to a unit vector, at the angle `atan(tan(r_d ω)/(2 tan(ω/2)))`; None
    /// beyond the limit.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        let angle = p_d.norm() * self.omega;
        if angle >= FRAC_PI_2 || !angle.is_finite() {
            return None;
        }
        let (sin, cos) = angle.sin_cos();
        let theta = sin.atan2(self.stretch * cos);
        (theta < self.max_angle_rad).then(|| radial_ray(p_d, theta))
    }
}
