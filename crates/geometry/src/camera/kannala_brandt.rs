//! The Kannala–Brandt fisheye model.

use super::field_of_view::FieldOfView;
use super::radial::{is_on_axis, project_radial, radial_jacobian, radial_ray};
use crate::numerics::monotone::{invert_monotone, monotone_limit};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use std::f64::consts::PI;

/// Fisheye projection: a point at the angle θ off the axis appears at the distance
/// `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)` from the centre of distortion, in its own
/// direction: `p_d = θ_d (x, y)/√(x² + y²)`.
///
/// OpenCV calls this model `fisheye`, ROS and Kalibr "equidistant". Points may lie beside and
/// behind the camera, up to the angle [`FieldOfView::limit_rad`], within which θ_d rises.
///
/// Source: J. Kannala and S. S. Brandt, "A generic camera model and calibration method for
/// conventional, wide-angle, and fish-eye lenses", PAMI 28(8), 2006.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KannalaBrandt {
    k: [f64; 4],
    field_of_view: FieldOfView,
}

impl KannalaBrandt {
    /// Creates the lens with the coefficients k1 to k4 and determines its limit.
    pub fn new(k: [f64; 4]) -> Self {
        let mut lens = Self {
            k,
            field_of_view: FieldOfView::up_to(PI),
        };
        let limit_rad = monotone_limit(|theta| lens.radius(theta).1, PI).min(PI);
        lens.field_of_view = FieldOfView::up_to(limit_rad);
        lens
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

    /// The coefficients k1 to k4.
    pub fn coefficients(&self) -> &[f64; 4] {
        &self.k
    }

    /// The radius θ_d and its derivative at the angle θ.
    pub fn radius(&self, theta: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.k;
        let q = theta * theta;
        let factor = 1.0 + q * (k1 + q * (k2 + q * (k3 + q * k4)));
        let slope = 1.0 + q * (3.0 * k1 + q * (5.0 * k2 + q * (7.0 * k3 + q * 9.0 * k4)));
        (theta * factor, slope)
    }

    /// Projects a point; None beyond the limit.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        project_radial(x_c, self.field_of_view.limit_rad(), 1.0, |theta| {
            self.radius(theta).0
        })
    }

    /// `∂p_d/∂x_c` ([`radial_jacobian`]).
    pub fn jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        radial_jacobian(x_c, 1.0, |theta| self.radius(theta))
    }

    /// `∂p_d/∂(k1, k2) = (θ³ e, θ⁵ e)`, `e = (x, y)/√(x² + y²)`.
    pub fn coefficient_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2<f64> {
        if is_on_axis(x_c) {
            return Matrix2::zeros();
        }
        let rho = x_c.xy().norm();
        let e = x_c.xy() / rho;
        let theta = rho.atan2(x_c.z);
        Matrix2::from_columns(&[e * theta.powi(3), e * theta.powi(5)])
    }

    /// Back-projects `p_d` to a unit vector; None beyond the limit.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        let theta = invert_monotone(
            |theta| self.radius(theta),
            p_d.norm(),
            self.field_of_view.limit_rad(),
        )?;
        Some(radial_ray(p_d, theta))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lenses() -> [KannalaBrandt; 4] {
        [
            KannalaBrandt::new([0.0; 4]),
            KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]),
            KannalaBrandt::new([0.05, -0.02, 0.004, -0.0003]),
            KannalaBrandt::new([-0.12, 0.0, 0.0, 0.0]),
        ]
    }

    proptest! {
        #[test]
        fn the_ray_inverts_the_projection(
            which in 0usize..4, share in 0.0f64..0.99, turn in -3.0f64..3.0, far in 0.1f64..30.0,
        ) {
            let lens = lenses()[which];
            let (sin, cos) = (lens.field_of_view().limit_rad() * share).sin_cos();
            let ray = Vector3::new(sin * turn.cos(), sin * turn.sin(), cos);
            let back = lens.project(&(ray * far)).and_then(|p_d| lens.ray(&p_d));
            prop_assert!(back.is_some_and(|back| (back - ray).norm() < 1e-9), "{lens:?}: {ray} \
                                                                               {back:?}");
        }

        #[test]
        fn jacobians_match_central_differences(
            which in 0usize..3, x in -2.0f64..2.0, y in -2.0f64..2.0, z in 0.1f64..2.0,
        ) {
            let lens = lenses()[which];
            let (x_c, step) = (Vector3::new(x, y, z), 1e-6);
            prop_assume!(lens.project(&(x_c - Vector3::z() * 1e-3)).is_some());
            let jacobian = lens.jacobian(&x_c);
            for axis in 0..3 {
                let mut delta = Vector3::zeros();
                delta[axis] = step;
                let at = |x_c: Vector3<f64>| lens.project(&x_c).unwrap();
                let numeric = (at(x_c + delta) - at(x_c - delta)) / (2.0 * step);
                prop_assert!((numeric - jacobian.column(axis)).norm() < 1e-6);
            }
            let by_coefficient = lens.coefficient_jacobian(&x_c);
            for which in 0..2 {
                let moved = |amount: f64| {
                    let mut k = *lens.coefficients();
                    k[which] += amount;
                    KannalaBrandt::new(k).project(&x_c).unwrap()
                };
                let numeric = (moved(step) - moved(-step)) / (2.0 * step);
                prop_assert!((numeric - by_coefficient.column(which)).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn the_limit_is_where_the_radius_stops_rising() {
        // θ − 0.12 θ³ rises up to 1/√0.36.
        let lens = lenses()[3];
        assert!((lens.field_of_view().limit_rad() - 1.0 / 0.6).abs() < 1e-12);
        assert_eq!(lenses()[0].field_of_view().limit_rad(), PI);
        let beyond = Vector3::new(1.7f64.sin(), 0.0, 1.7f64.cos());
        assert!(lens.project(&beyond).is_none());
        assert!(lenses()[0].project(&beyond).is_some(), "behind the camera");
    }

    #[test]
    fn the_axis_itself_is_the_middle() {
        for lens in lenses() {
            let on_axis = Vector3::new(0.0, 0.0, 2.0);
            assert_eq!(lens.project(&on_axis), Some(Vector2::zeros()));
            assert_eq!(lens.ray(&Vector2::zeros()), Some(Vector3::z()));
            let beside = Vector3::new(1e-5, 0.0, 2.0);
            assert!((lens.jacobian(&on_axis) - lens.jacobian(&beside)).norm() < 1e-4);
            assert!(lens.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
        }
    }
}
