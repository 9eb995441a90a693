//! Points of a nominal section at whole degrees of the clock.

use nalgebra::Vector3;
use std::f64::consts::TAU;
use tunnelstitch_geometry::surface::{Surface, WallPoint};

/// Points around a section: one at each degree from twelve o'clock towards three.
pub(super) const DEGREES: usize = 360;
/// Largest deviation of a circle's points from their mean distance, radii.
const MAX_CIRCLE_ERROR: f64 = 1e-6;

/// A nominal section: its points at whole degrees as seen from the axis.
#[derive(Clone, Debug)]
pub(super) struct SectionOutline {
    /// The points on the unrolled wall.
    pub(super) walls: Vec<WallPoint>,
    /// The points in the world, metres.
    pub(super) points: Vec<Vector3<f64>>,
    /// Unit normals, outwards.
    pub(super) normals: Vec<Vector3<f64>>,
    /// Radius, metres; None for a section that is no circle.
    pub(super) radius_m: Option<f64>,
}

impl SectionOutline {
    /// The section of a surface at a chainage, metres.
    pub(super) fn new(surface: &dyn Surface, h_m: f64) -> Self {
        let angle = |k: usize| TAU * k as f64 / DEGREES as f64;
        let s_m: Vec<f64> = (0..DEGREES).map(|k| surface.s_at_m(angle(k))).collect();
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        surface.lattice(&s_m, &[h_m], &mut points);
        surface.normals(&s_m, &[h_m], &mut normals);
        Self {
            walls: s_m.iter().map(|&s_m| WallPoint { s_m, h_m }).collect(),
            radius_m: circle_radius_m(&points),
            points,
            normals,
        }
    }

    /// The angle of point k from twelve o'clock towards three, radians.
    pub(super) fn angle_rad(k: usize) -> f64 {
        TAU * k as f64 / DEGREES as f64
    }
}

/// True if the section of a surface at a chainage (metres) is a circle.
pub(super) fn is_circle(surface: &dyn Surface, h_m: f64) -> bool {
    SectionOutline::new(surface, h_m).radius_m.is_some()
}

/// Radius of points that lie evenly around a circle; None if they do not.
fn circle_radius_m(points: &[Vector3<f64>]) -> Option<f64> {
    let count = points.len() as f64;
    let centre = points.iter().sum::<Vector3<f64>>() / count;
    let distances = points.iter().map(|point| (point - centre).norm());
    let radius_m = distances.clone().sum::<f64>() / count;
    let mut errors = distances.map(|distance| (distance - radius_m).abs());
    errors
        .all(|error| error <= MAX_CIRCLE_ERROR * radius_m)
        .then_some(radius_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::section::Ellipse;
    use tunnelstitch_geometry::surface::{Circle, Prism};

    #[test]
    fn only_circles_are_circles_and_three_o_clock_is_at_x() {
        let circle = SectionOutline::new(&Circle::new(3.0).unwrap(), 7.0);
        assert!((circle.radius_m.unwrap() - 3.0).abs() < 1e-12);
        assert!((circle.points[90] - Vector3::new(3.0, 7.0, 0.0)).norm() < 1e-12);
        assert!((circle.normals[0] - Vector3::z()).norm() < 1e-12);
        let ellipse = Prism::new(Box::new(Ellipse::new(6.0, 6.01).unwrap()));
        assert!(!is_circle(&ellipse, 0.0));
    }
}
