//! The circle.

use super::outline::{OutlineHit, OutlinePoint, Section, forward_root};
use nalgebra::Vector2;
use std::f64::consts::TAU;

/// A circle around the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircleOutline {
    /// Radius, metres.
    pub radius_m: f64,
}

impl Section for CircleOutline {
    fn perimeter_m(&self) -> f64 {
        TAU * self.radius_m
    }

    fn at(&self, s_m: f64) -> OutlinePoint {
        let (sin, cos) = (s_m / self.radius_m).sin_cos();
        OutlinePoint {
            point: Vector2::new(sin, cos) * self.radius_m,
            tangent: Vector2::new(cos, -sin),
        }
    }

    /// Intersects the ray with the circle; see [`crate::surface::Circle`].
    fn hit(&self, from: &Vector2<f64>, d: &Vector2<f64>) -> OutlineHit {
        let range = forward_root(
            d.norm_squared(),
            d.dot(from),
            from.norm_squared() - self.radius_m * self.radius_m,
        );
        let point = from + d * range;
        OutlineHit {
            range,
            s_m: self.radius_m * point.x.atan2(point.y).rem_euclid(TAU),
        }
    }

    fn contains(&self, point: &Vector2<f64>) -> bool {
        point.norm() < self.radius_m
    }

    fn is_round(&self) -> bool {
        true
    }

    fn farthest_m(&self) -> f64 {
        self.radius_m
    }
}
