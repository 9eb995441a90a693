//! The interface of outlines.

use nalgebra::Vector2;
use std::f64::consts::TAU;

/// A point of the outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlinePoint {
    /// Position, metres.
    pub point: Vector2<f64>,
    /// `∂point/∂s`, a unit vector.
    pub tangent: Vector2<f64>,
}

/// The intersection of a ray in the plane of the section with the outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineHit {
    /// Multiple of the ray's direction that reaches the outline.
    pub range: f64,
    /// Arc length of the intersection, metres.
    pub s_m: f64,
}

/// A convex outline around the axis.
pub trait Section: Send + Sync + std::fmt::Debug {
    /// Length of the outline, metres.
    fn perimeter_m(&self) -> f64;

    /// The point at arc length `s_m`, which is periodic.
    fn at(&self, s_m: f64) -> OutlinePoint;

    /// Intersects the ray `from + range · d`; `from` must be inside and `d` not zero.
    fn hit(&self, from: &Vector2<f64>, d: &Vector2<f64>) -> OutlineHit;

    /// True if a point is inside.
    fn contains(&self, point: &Vector2<f64>) -> bool;

    /// True if the outline is invariant under rotation about the axis.
    fn is_round(&self) -> bool {
        false
    }

    /// Distance of the outline from the axis in a direction (the x axis for a zero vector), metres.
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

/// The arc length on the outline at an angle from z towards x, metres.
pub fn s_at_m(section: &dyn Section, angle_rad: f64) -> f64 {
    let (sin, cos) = angle_rad.sin_cos();
    section.hit(&Vector2::zeros(), &Vector2::new(sin, cos)).s_m
}

/// The greater root of `a λ² + 2 b λ + c = 0`, without cancellation for c ≤ 0.
pub(super) fn forward_root(a: f64, b: f64, c: f64) -> f64 {
    let root = (b * b - a * c).max(0.0).sqrt();
    if b > 0.0 {
        -c / (b + root)
    } else {
        (root - b) / a
    }
}
