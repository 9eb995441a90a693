//! The interface of outlines.

use nalgebra::Vector2;
use std::f64::consts::TAU;

/// A point of the outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlinePoint {
    /// Where it is, metres.
    pub point: Vector2<f64>,
    /// `∂point/∂s`, a unit vector.
    pub tangent: Vector2<f64>,
}

/// Where a ray in the plane of the section meets the outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineHit {
    /// Multiple of the ray's direction that reaches the outline.
    pub range: f64,
    /// Where on the outline, metres from its beginning.
    pub s_m: f64,
}

/// A convex outline around the axis.
pub trait Section: Send + Sync + std::fmt::Debug {
    /// Its length, metres.
    fn perimeter_m(&self) -> f64;

    /// The point at `s_m`, which is periodic.
    fn at(&self, s_m: f64) -> OutlinePoint;

    /// Where the ray `from + range · d` from inside meets it. `from` must be inside and `d` not
    /// zero.
    fn hit(&self, from: &Vector2<f64>, d: &Vector2<f64>) -> OutlineHit;

    /// Whether a point is inside.
    fn contains(&self, point: &Vector2<f64>) -> bool;

    /// Whether turning about the axis leaves it as it is.
    fn is_round(&self) -> bool {
        false
    }

    /// Distance of the outline from the axis in a direction (that of the x axis for none), metres.
    fn distance_m(&self, towards: &Vector2<f64>) -> f64 {
        let d = towards.try_normalize(0.0).unwrap_or(Vector2::x());
        self.hit(&Vector2::zeros(), &d).range
    }

    /// Greatest distance of the outline from the axis, metres.
    fn farthest_m(&self) -> f64;
}

/// The angle of the point at `s_m` as seen from the axis, from z towards x, in `[0, 2π)`, radians.
pub fn angle_rad(section: &dyn Section, s_m: f64) -> f64 {
    let point = section.at(s_m).point;
    point.x.atan2(point.y).rem_euclid(TAU)
}

/// The place on the outline at an angle from z towards x, metres from its beginning.
pub fn s_at_m(section: &dyn Section, angle_rad: f64) -> f64 {
    let (sin, cos) = angle_rad.sin_cos();
    section.hit(&Vector2::zeros(), &Vector2::new(sin, cos)).s_m
}

/// The greater root of `a λ² + 2 b λ + c = 0`, without cancellation where c ≤ 0, as from inside.
pub(super) fn forward_root(a: f64, b: f64, c: f64) -> f64 {
    let root = (b * b - a * c).max(0.0).sqrt();
    if b > 0.0 {
        -c / (b + root)
    } else {
        (root - b) / a
    }
}
