//! The outline of a tunnel across its axis.
//!
//! Coordinates `(x, z)` in metres, the axis at the origin, z upwards to twelve o'clock. The outline
//! is convex, closed, and runs from the z axis (`s = 0`) towards x, parametrised by its length `s`.

mod ellipse;
mod pieces;

pub use ellipse::Ellipse;
pub use pieces::{Piece, Pieces};

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

/// The circle around the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// Its radius, metres.
    pub radius_m: f64,
}

impl Section for Round {
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

    /// As [`super::Circle`].
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

/// The greater root of `a λ² + 2 b λ + c = 0`, without cancellation where c ≤ 0, as from inside.
fn forward_root(a: f64, b: f64, c: f64) -> f64 {
    let root = (b * b - a * c).max(0.0).sqrt();
    if b > 0.0 {
        -c / (b + root)
    } else {
        (root - b) / a
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sections() -> Vec<Box<dyn Section>> {
        vec![
            Box::new(Round { radius_m: 2.0 }),
            Box::new(Ellipse::new(4.0, 2.5).unwrap()),
            Box::new(Ellipse::new(1.0, 8.0).unwrap()),
            Box::new(Pieces::rectangle(4.0, 3.0).unwrap()),
            Box::new(Pieces::horseshoe(4.0, 3.5).unwrap()),
        ]
    }

    proptest! {
        /// A ray from any point inside towards a point of the outline meets it there.
        #[test]
        fn rays_meet_the_point_they_are_sent_to(
            which in 0usize..5, share in 0.0f64..1.0, inside in 0.0f64..0.98, towards in 0.0f64..1.0, length in 0.01f64..100.0,
        ) {
            let section = &sections()[which];
            let perimeter_m = section.perimeter_m();
            let from = section.at(towards * perimeter_m).point * inside;
            prop_assert!(section.contains(&from));
            let target = section.at(share * perimeter_m);
            let d = target.point - from;
            // Not where the ray grazes the outline.
            prop_assume!(d.perp(&target.tangent).abs() > 1e-3 * d.norm());
            let hit = section.hit(&from, &(d * length));
            prop_assert!((hit.range * length - 1.0).abs() < 1e-9, "{hit:?}");
            let point = section.at(hit.s_m).point;
            prop_assert!((point - target.point).norm() < 1e-9, "{point} {target:?}");
            prop_assert!((0.0..=perimeter_m).contains(&hit.s_m));
        }

        /// The tangent is the derivative of the point, of length one, and the outline closes.
        #[test]
        fn s_is_the_length_of_the_outline(which in 0usize..5, share in 0.0f64..1.0) {
            let section = &sections()[which];
            let s_m = share * section.perimeter_m();
            let at = section.at(s_m);
            prop_assert!((at.tangent.norm() - 1.0).abs() < 1e-12);
            let step = 1e-6;
            let [before, after] = [-step, step].map(|step| section.at(s_m + step));
            // Corners have none.
            prop_assume!((before.tangent - after.tangent).norm() < 1e-4);
            let numeric = (after.point - before.point) / (2.0 * step);
            prop_assert!((numeric - at.tangent).norm() < 1e-7, "{numeric} {at:?}");
            let around = section.at(s_m + section.perimeter_m());
            prop_assert!((around.point - at.point).norm() < 1e-9);
            prop_assert!(at.point.norm() <= section.farthest_m() * (1.0 + 1e-12));
            prop_assert!(!section.contains(&(at.point * 1.000_001)));
            prop_assert!((section.distance_m(&at.point) / at.point.norm() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn outlines_begin_at_twelve_and_run_towards_x() {
        for section in sections() {
            let start = section.at(0.0);
            assert!(start.point.x.abs() < 1e-12 && start.point.y > 0.0);
            assert!(start.tangent.x > 0.999_999);
            // All around and back, in steps.
            let n = 20_000;
            let point = |k: usize| {
                section
                    .at(section.perimeter_m() * k as f64 / f64::from(n))
                    .point
            };
            let length: f64 = (0..n as usize)
                .map(|k| (point(k + 1) - point(k)).norm())
                .sum();
            // Each of four corners is cut by half a step at the most.
            assert!((length / section.perimeter_m() - 1.0).abs() < 2.0 / f64::from(n));
        }
    }
}
