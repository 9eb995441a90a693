//! A wall that deviates from its nominal shape.

use super::error::SurfaceError;
use super::gauge::Gauge;
use super::newton::settle_hit;
use super::radial_field::RadialField;
use super::shape::Surface;
use super::wall::{Hit, WallFrame, WallPoint};
use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::ops::Deref;
use std::sync::Arc;

/// Step of the central differences for the tangents, share of the perimeter: errors of 1e-10 by
/// curvature, and of 1e-11 by rounding.
const DIFFERENCE: f64 = 1e-6;

/// A nominal surface displaced along its normal by a field:
/// `X(s, h) = X_0(s, h) + δ(s, h) n(s, h)`, `n = e_s × e_h/|e_s × e_h|` outwards.
///
/// Wall coordinates stay those of the nominal surface `N`, so that surveys of a wall as planned and
/// as built can be laid over each other.
#[derive(Clone, Debug)]
pub struct Displaced<N> {
    nominal: N,
    field: RadialField,
}

/// The nominal wall displaced by a field, or itself if there is none.
pub fn displaced(nominal: &Arc<dyn Surface>, field: Option<RadialField>) -> Arc<dyn Surface> {
    match field {
        Some(field) => Arc::new(Displaced::new(Arc::clone(nominal), field)),
        None => Arc::clone(nominal),
    }
}

impl<N: Deref<Target: Surface>> Displaced<N> {
    /// The nominal surface displaced by the field, whose perimeter must be that of the surface.
    pub fn new(nominal: N, field: RadialField) -> Self {
        Self { nominal, field }
    }

    /// The field.
    pub fn field(&self) -> &RadialField {
        &self.field
    }

    /// The point of the wall at `wall`, in the world, metres.
    fn point(&self, wall: WallPoint) -> Vector3<f64> {
        let nominal = self.nominal.frame(wall);
        nominal.x_w + nominal.normal() * self.field.at(wall).delta_m
    }
}

impl<N> Surface for Displaced<N>
where
    N: Deref<Target: Surface> + Send + Sync + std::fmt::Debug,
{
    /// Intersects by Newton's method from the nominal intersection.
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError> {
        let nominal = self.nominal.hit(t, d)?;
        // Within a node's reach the wall is nearly plane.
        let longest_m = self.field.lattice().spacing_m();
        Ok(settle_hit(self, nominal, [t, d], longest_m))
    }

    /// Computes the tangents by central differences, which hold those of the normal as well.
    fn frame(&self, wall: WallPoint) -> WallFrame {
        let step_m = DIFFERENCE * self.perimeter_m();
        let at = |ds_m: f64, dh_m: f64| {
            self.point(WallPoint {
                s_m: wall.s_m + ds_m,
                h_m: wall.h_m + dh_m,
            })
        };
        WallFrame {
            x_w: self.point(wall),
            e_s: (at(step_m, 0.0) - at(-step_m, 0.0)) / (2.0 * step_m),
            e_h: (at(0.0, step_m) - at(0.0, -step_m)) / (2.0 * step_m),
        }
    }

    fn lattice(&self, s_m: &[f64], h_m: &[f64], points: &mut Vec<Vector3<f64>>) {
        let mut normals = Vec::new();
        self.nominal.normals(s_m, h_m, &mut normals);
        self.nominal.lattice(s_m, h_m, points);
        let displacements = self.field.grid(s_m, h_m);
        for ((point, normal), delta_m) in points.iter_mut().zip(normals).zip(displacements) {
            *point += normal * delta_m;
        }
    }

    fn perimeter_m(&self) -> f64 {
        self.nominal.perimeter_m()
    }

    /// The gauge of the nominal surface. Its motions move the displacement as well: trajectories
    /// that are estimated with the wall's shape are compared up to them.
    fn gauge(&self) -> Gauge {
        self.nominal.gauge()
    }

    fn chainage_m(&self, t: &Vector3<f64>) -> f64 {
        self.nominal.chainage_m(t)
    }

    fn straightened(&self, pose: &Pose) -> Pose {
        self.nominal.straightened(pose)
    }

    fn angle_rad(&self, s_m: f64) -> f64 {
        self.nominal.angle_rad(s_m)
    }

    fn s_at_m(&self, angle_rad: f64) -> f64 {
        self.nominal.s_at_m(angle_rad)
    }

    /// Checks the camera against the nominal wall, moved by the displacement that the wall has in
    /// its direction.
    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError> {
        self.nominal.check_inside(t)?;
        let straight = self
            .nominal
            .straightened(&Pose::new(Default::default(), *t));
        let wall = WallPoint {
            s_m: self.s_at_m(straight.t_wc.x.atan2(straight.t_wc.z)),
            h_m: self.chainage_m(t),
        };
        let normal = self.nominal.frame(wall).normal();
        self.nominal
            .check_inside(&(t - normal * self.field.at(wall).delta_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::circle::Circle;
    use crate::surface::prism::Prism;
    use crate::surface::radial_field::tests::irregular;
    use crate::surface::section::Ellipse;
    use proptest::prelude::*;

    fn irregular_wall() -> Displaced<Box<dyn Surface>> {
        Displaced::new(Box::new(Circle::new(3.0).unwrap()), irregular(0.03))
    }

    proptest! {
        #[test]
        fn a_ray_meets_the_displaced_wall(
            s_m in 0.0f64..18.8, h_m in -2.0f64..8.0, x in -1.0f64..1.0, y in -2.0f64..8.0,
            z in -1.0f64..1.0,
        ) {
            let wall = irregular_wall();
            let t = Vector3::new(x, y, z);
            let target = wall.frame(WallPoint { s_m, h_m }).x_w;
            let d = (target - t) * 0.4;
            // Rays that graze the wall may meet it elsewhere first.
            let across = (target - t).xz().norm() / (target - t).norm();
            prop_assume!(across > 0.6);
            let hit = wall.hit(&t, &d).unwrap();
            prop_assert!((hit.range - 2.5).abs() < 1e-9, "{}", hit.range);
            prop_assert!((hit.wall.s_m - s_m).abs() < 1e-8);
            prop_assert!((hit.wall.h_m - h_m).abs() < 1e-8);
        }
    }

    #[test]
    fn a_displacement_is_outwards() {
        let wall = irregular_wall();
        for s_m in [0.0, 4.0, 11.0, 18.0] {
            let at = WallPoint { s_m, h_m: 1.0 };
            let delta_m = wall.field().at(at).delta_m;
            let radius_m = wall.frame(at).x_w.xz().norm();
            assert!((radius_m - 3.0 - delta_m).abs() < 1e-12);
        }
    }

    #[test]
    fn an_oval_is_a_displaced_circle() {
        // r + δ with δ = a cos 2θ, as nearly as a hundred nodes around can be.
        let lattice = crate::surface::SplineLattice {
            perimeter_m: Circle::new(3.0).unwrap().perimeter_m(),
            columns: 128,
            origin: WallPoint { s_m: 0.0, h_m: 0.0 },
        };
        let cosine = |k: usize| (2.0 * std::f64::consts::TAU * (k % 128) as f64 / 128.0).cos();
        let coefficients_m = (0..128 * 12).map(|k| 0.03 * cosine(k)).collect();
        let field = RadialField::new(lattice, -4, coefficients_m);
        let circle = Circle::new(3.0).unwrap();
        let wall = Displaced::new(&circle, field);
        let ellipse = Prism::new(Box::new(Ellipse::new(5.94, 6.06).unwrap()));
        for s_m in [0.0, 0.7, 5.0, 13.0] {
            let point = wall.point(WallPoint { s_m, h_m: 0.1 });
            // They differ by a²/r.
            assert!(ellipse.check_inside(&(point * 1.0003)).is_err());
            assert!(ellipse.check_inside(&(point * 0.9995)).is_ok());
        }
    }

    #[test]
    fn the_lattice_is_the_frame_point_by_point() {
        let wall = irregular_wall();
        let (s, h) = ([0.1, 0.2, 18.8], [-1.0, 4.0]);
        let mut points = Vec::new();
        wall.lattice(&s, &h, &mut points);
        for (k, x_w) in points.iter().enumerate() {
            let at = WallPoint {
                s_m: s[k % 3],
                h_m: h[k / 3],
            };
            assert!((x_w - wall.frame(at).x_w).norm() < 1e-12);
        }
    }

    #[test]
    fn a_camera_between_nominal_and_displaced_wall_is_outside() {
        let lattice = crate::surface::SplineLattice {
            perimeter_m: 3.0 * std::f64::consts::TAU,
            columns: 8,
            origin: WallPoint { s_m: 0.0, h_m: 0.0 },
        };
        let field = RadialField::new(lattice, -4, vec![-0.1; 8 * 10]);
        let circle = Circle::new(3.0).unwrap();
        let wall = Displaced::new(&circle, field);
        assert!(wall.check_inside(&Vector3::new(2.89, 0.0, 0.0)).is_ok());
        let outside = wall.check_inside(&Vector3::new(2.91, 0.0, 0.0));
        assert!(matches!(outside, Err(SurfaceError::CameraOutside { .. })));
    }
}
