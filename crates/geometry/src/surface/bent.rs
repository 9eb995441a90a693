//! A wall along a bend.

use super::bend::{Bend, BendFrame};
use super::error::SurfaceError;
use super::gauge::Gauge;
use super::newton::settle_hit;
use super::shape::Surface;
use super::wall::{Hit, WallFrame, WallPoint};
use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::ops::Deref;
use std::sync::Arc;

/// Longest step of Newton's method, share of the perimeter.
const LONGEST_STEP: f64 = 0.05;

/// A straight surface along a [`Bend`]: `X(s, h) = C(h) + Q(h) (X_0(s, h) − (0, h, 0))`.
///
/// Wall coordinates stay those of the straight surface `N`.
#[derive(Clone, Debug)]
pub struct Bent<N> {
    straight: N,
    bend: Bend,
}

/// The straight wall along a bend, or itself if there is none.
pub fn bent(straight: &Arc<dyn Surface>, bend: Option<Bend>) -> Arc<dyn Surface> {
    match bend {
        Some(bend) => Arc::new(Bent {
            straight: Arc::clone(straight),
            bend,
        }),
        None => Arc::clone(straight),
    }
}

/// Moves a point of the straight tunnel at chainage `h_m`.
fn moved(at: &BendFrame, point: &Vector3<f64>, h_m: f64) -> Vector3<f64> {
    at.point + at.frame * (point - Vector3::y() * h_m)
}

impl<N> Surface for Bent<N>
where
    N: Deref<Target: Surface> + Send + Sync + std::fmt::Debug,
{
    /// Intersects by Newton's method from where the ray would meet the wall if the tunnel went on
    /// straight from the section of its start.
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError> {
        let here = self.straightened(&Pose::new(Default::default(), *t));
        let start = self.straight.hit(&here.t_wc, &(here.r_wc * d))?;
        let longest_m = LONGEST_STEP * self.perimeter_m();
        Ok(settle_hit(self, start, [t, d], longest_m))
    }

    /// `∂X/∂s = Q ∂X_0/∂s`, `∂X/∂h = Q (∂X_0/∂h + (y × c) × (X_0 − (0, h, 0)))`.
    fn frame(&self, wall: WallPoint) -> WallFrame {
        let at = self.bend.at(wall.h_m);
        let straight = self.straight.frame(wall);
        let across = straight.x_w - Vector3::y() * wall.h_m;
        WallFrame {
            x_w: at.point + at.frame * across,
            e_s: at.frame * straight.e_s,
            e_h: at.frame * (straight.e_h + self.bend.turn_per_m().cross(&across)),
        }
    }

    fn lattice(&self, s_m: &[f64], h_m: &[f64], points: &mut Vec<Vector3<f64>>) {
        self.straight.lattice(s_m, h_m, points);
        for (row, &h_m) in points.chunks_mut(s_m.len().max(1)).zip(h_m) {
            let at = self.bend.at(h_m);
            for point in row {
                *point = moved(&at, point, h_m);
            }
        }
    }

    /// The section stays at right angles to the axis, so normals turn with it.
    fn normals(&self, s_m: &[f64], h_m: &[f64], normals: &mut Vec<Vector3<f64>>) {
        self.straight.normals(s_m, h_m, normals);
        for (row, &h_m) in normals.chunks_mut(s_m.len().max(1)).zip(h_m) {
            let at = self.bend.at(h_m);
            for normal in row {
                *normal = at.frame * *normal;
            }
        }
    }

    fn perimeter_m(&self) -> f64 {
        self.straight.perimeter_m()
    }

    /// The gauge of the straight surface. Its motions move the bend as well: trajectories that are
    /// estimated with the bend are compared up to them.
    fn gauge(&self) -> Gauge {
        self.straight.gauge()
    }

    fn chainage_m(&self, t: &Vector3<f64>) -> f64 {
        self.bend.chainage_m(t)
    }

    fn straightened(&self, pose: &Pose) -> Pose {
        self.bend.straightened(pose)
    }

    fn angle_rad(&self, s_m: f64) -> f64 {
        self.straight.angle_rad(s_m)
    }

    fn s_at_m(&self, angle_rad: f64) -> f64 {
        self.straight.s_at_m(angle_rad)
    }

    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError> {
        if !t.iter().all(|v| v.is_finite()) {
            return Err(SurfaceError::NotFinite);
        }
        let here = self.straightened(&Pose::new(Default::default(), *t));
        self.straight.check_inside(&here.t_wc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::centreline::{CentrePoint, Centreline};
    use crate::surface::circle::Circle;
    use crate::surface::section::Ellipse;
    use crate::surface::swept::Swept;
    use proptest::prelude::*;

    const BEND: Bend = Bend {
        curvature_per_m: [0.02, -0.01],
        at_h_m: 2.0,
    };

    fn wall() -> Bent<Box<dyn Surface>> {
        Bent {
            straight: Box::new(Circle::new(3.0).unwrap()),
            bend: BEND,
        }
    }

    proptest! {
        #[test]
        fn a_ray_meets_the_bent_wall(
            s_m in 0.0f64..18.8, h_m in -2.0f64..8.0, x in -1.0f64..1.0, y in -2.0f64..8.0,
            z in -1.0f64..1.0,
        ) {
            let wall = wall();
            let t = BEND.bent(&Pose::new(Default::default(), Vector3::new(x, y, z))).t_wc;
            let target = wall.frame(WallPoint { s_m, h_m }).x_w;
            let d = (target - t) * 0.4;
            // Rays that graze the wall may meet it elsewhere first.
            prop_assume!((h_m - y).abs() < 3.0);
            let hit = wall.hit(&t, &d).unwrap();
            prop_assert!((hit.range - 2.5).abs() < 1e-9, "{}", hit.range);
            prop_assert!((hit.wall.s_m - s_m).abs() < 1e-8);
            prop_assert!((hit.wall.h_m - h_m).abs() < 1e-8);
        }
    }

    #[test]
    fn tangents_are_derivatives_and_the_lattice_has_the_same_points() {
        let wall = wall();
        let (s_m, h_m) = ([0.3, 9.0], [-1.0, 5.0]);
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        wall.lattice(&s_m, &h_m, &mut points);
        wall.normals(&s_m, &h_m, &mut normals);
        for (k, (point, normal)) in points.iter().zip(&normals).enumerate() {
            let at = WallPoint {
                s_m: s_m[k % 2],
                h_m: h_m[k / 2],
            };
            let x_w = |ds_m: f64, dh_m: f64| {
                let near = WallPoint {
                    s_m: at.s_m + ds_m,
                    h_m: at.h_m + dh_m,
                };
                wall.frame(near).x_w
            };
            let frame = wall.frame(at);
            assert!((frame.x_w - point).norm() < 1e-12);
            assert!((frame.normal() - normal).norm() < 1e-12);
            let step_m = 1e-5;
            let e_s = (x_w(step_m, 0.0) - x_w(-step_m, 0.0)) / (2.0 * step_m);
            let e_h = (x_w(0.0, step_m) - x_w(0.0, -step_m)) / (2.0 * step_m);
            assert!((frame.e_s - e_s).norm() < 1e-8);
            assert!((frame.e_h - e_h).norm() < 1e-8);
        }
    }

    /// A section swept along points of the arc is the same wall.
    #[test]
    fn a_bent_wall_is_swept_along_an_arc() {
        let wall = wall();
        let start_m = -20.0;
        let first = BEND.at(start_m);
        let point = |k: i32| {
            let at = BEND.at(start_m + 0.5 * f64::from(k));
            CentrePoint {
                point: at.point,
                radius_m: None,
            }
        };
        let points: Vec<CentrePoint> = (0..100).map(point).collect();
        let line = Centreline::through(&points, 3.0, 3.0).unwrap();
        let swept = Swept::new(Box::new(Ellipse::new(6.0, 6.0).unwrap()), line);
        assert!((first.point - swept.line().at(0.0).point).norm() < 1e-12);
        for (s_m, h_m) in [(0.0, 1.0), (4.0, -3.0), (12.0, 6.0)] {
            let a = wall.frame(WallPoint { s_m, h_m }).x_w;
            let h_m = h_m - start_m;
            let b = swept.frame(WallPoint { s_m, h_m }).x_w;
            assert!((a - b).norm() < 1e-5, "{a} {b}");
        }
    }
}
