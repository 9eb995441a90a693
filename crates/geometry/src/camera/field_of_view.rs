//! Field of view of the lenses that see beside and behind them.

use nalgebra::Vector3;
use std::f64::consts::PI;

/// The directions that a lens shows: those at less than a limit off its axis.
///
/// The limit is that of the model, where the radius stops rising, or a smaller one that a
/// calibration gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOfView {
    /// Largest angle to be used, radians; π if only the model limits it.
    max_angle_rad: f64,
    limit_rad: f64,
    /// Cosine of the limit.
    min_cos: f64,
}

impl FieldOfView {
    /// The field of view of a model up to the angle `limit_rad` off the axis, radians.
    pub fn up_to(limit_rad: f64) -> Self {
        Self {
            max_angle_rad: PI,
            limit_rad,
            min_cos: limit_rad.cos(),
        }
    }

    /// The field of view of a model down to the cosine `min_cos`; all directions if that is −1 or
    /// less.
    pub fn down_to(min_cos: f64) -> Self {
        Self {
            max_angle_rad: PI,
            limit_rad: min_cos.clamp(-1.0, 1.0).acos(),
            min_cos,
        }
    }

    /// This field of view, limited to `max_angle_rad` off the axis.
    pub fn limited_to(&self, max_angle_rad: f64) -> Self {
        let max_angle_rad = max_angle_rad.min(PI);
        Self {
            max_angle_rad,
            limit_rad: self.limit_rad.min(max_angle_rad),
            min_cos: self.min_cos.max(max_angle_rad.cos()),
        }
    }

    /// The largest angle off the axis to be used, radians; 180° if there is no limit.
    pub fn max_angle_rad(&self) -> f64 {
        self.max_angle_rad
    }

    /// The limit: the largest angle off the axis, radians.
    pub fn limit_rad(&self) -> f64 {
        self.limit_rad
    }

    /// True if a point lies within.
    pub fn shows(&self, x_c: &Vector3<f64>) -> bool {
        x_c.z > self.min_cos * x_c.norm()
    }

    /// True if the ray, a unit vector, lies within.
    pub fn shows_ray(&self, ray: &Vector3<f64>) -> bool {
        ray.z > self.min_cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smaller_of_two_limits_holds() {
        let wide = FieldOfView::up_to(2.0);
        let narrow = wide.limited_to(1.2);
        let at = |angle: f64| Vector3::new(angle.sin(), 0.0, angle.cos());
        assert_eq!((narrow.max_angle_rad(), narrow.limit_rad()), (1.2, 1.2));
        assert!(wide.shows(&(at(1.9) * 3.0)) && !wide.shows_ray(&at(2.1)));
        assert!(narrow.shows_ray(&at(1.1)) && !narrow.shows(&(at(1.3) * 3.0)));
        let limit = narrow.limited_to(1.8);
        assert_eq!((limit.max_angle_rad(), limit.limit_rad()), (1.8, 1.2));
        let cosine = FieldOfView::down_to(2f64.cos());
        assert!((cosine.limit_rad() - 2.0).abs() < 1e-15);
        assert_eq!(FieldOfView::down_to(-1.5).limit_rad(), PI);
    }
}
