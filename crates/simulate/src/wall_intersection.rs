//! Intersection of rays with the wall of the simulated tunnel.
//!
//! A round straight tunnel has a closed form. In all others, as in one whose lining deviates from
//! it, the ray is marched until it leaves the inside, and the crossing is found by false position.

use crate::cross_section::CrossSection;
use crate::false_position::{RayPoint, find_crossing};
use crate::lining::lining::Lining;
use crate::tunnel::Tunnel;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tunnelstitch_geometry::surface::Centreline;

/// Point of the wall that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallHit {
    /// Arc length around the section as an angle: 2π once around, from z towards x.
    pub theta: f64,
    /// Chainage, metres.
    pub h_m: f64,
    /// Position λ on the ray `t + λ d`.
    pub lambda: f64,
}

impl WallHit {
    /// Result for a ray that meets no wall.
    pub const NONE: Self = Self {
        theta: f64::NAN,
        h_m: f64::NAN,
        lambda: f64::NAN,
    };
}

/// Maximum steps along a ray, each a third of the section's inner radius.
const MAX_RAY_STEPS: usize = 2000;

/// Intersection of rays from one camera centre with the wall.
pub(super) struct RayCaster<'a> {
    tunnel: &'a Tunnel,
    /// Camera centre, metres.
    pub t: Vector3<f64>,
    /// Chainage of the camera, metres.
    pub h_m: f64,
    /// Unit direction of the axis at the camera.
    along: Vector3<f64>,
    /// Maximum distance of the wall from the camera along the tunnel, if limited, metres.
    reach_m: Option<f64>,
}

impl<'a> RayCaster<'a> {
    /// The ray caster for a camera at `t` in a tunnel.
    pub fn new(tunnel: &'a Tunnel, t: Vector3<f64>) -> Self {
        Self {
            tunnel,
            h_m: tunnel.chainage_m(&t),
            along: tunnel.direction_at(&t),
            t,
            reach_m: None,
        }
    }

    /// Limits the wall to a distance from the camera along the tunnel, metres: rays that meet it
    /// farther away or nowhere end at that distance.
    pub fn with_reach(self, reach_m: Option<f64>) -> Self {
        Self { reach_m, ..self }
    }

    /// Intersects a ray of direction `d` with the wall; NaN if it meets none.
    #[inline]
    pub fn intersect(&self, d: &Vector3<f64>) -> WallHit {
        let hit = match self.tunnel {
            Tunnel::Round(radius_m) => self.intersect_round(*radius_m, d),
            Tunnel::AsBuilt(lining) => self.march_to_lining(lining, d),
            Tunnel::Shaped { section, line } => self.march_to_section(section, line.as_ref(), d),
        };
        match self.reach_m {
            Some(reach_m) => self.limit(hit, d, reach_m),
            None => hit,
        }
    }

    /// Moves a hit beyond `reach_m`, metres, or without a wall to that distance.
    fn limit(&self, hit: WallHit, d: &Vector3<f64>, reach_m: f64) -> WallHit {
        if (hit.h_m - self.h_m).abs() <= reach_m {
            return hit;
        }
        WallHit {
            theta: if hit.theta.is_nan() { 0.0 } else { hit.theta },
            h_m: self.h_m + reach_m.copysign(self.along.dot(d)),
            lambda: reach_m / d.norm(),
        }
    }

    /// Intersects a ray with a circular cylinder in closed form.
    ///
    /// With `d̂ = d_xz/|d_xz|`, the distance along it is `−t·d̂ + √(r² − (t × d̂)²)`: from the foot
    /// of the perpendicular from the axis to the circle.
    #[inline]
    fn intersect_round(&self, radius_m: f64, d: &Vector3<f64>) -> WallHit {
        let across = (d.x * d.x + d.z * d.z).sqrt();
        let (dx, dz) = (d.x / across, d.z / across);
        let foot = self.t.x * dx + self.t.z * dz;
        let aside = self.t.x * dz - self.t.z * dx;
        let way = (radius_m * radius_m - aside * aside).sqrt() - foot;
        let theta = (self.t.x + way * dx).atan2(self.t.z + way * dz);
        WallHit {
            theta: if theta < 0.0 { theta + TAU } else { theta },
            h_m: self.t.y + way / across * d.y,
            lambda: way / across,
        }
    }

    /// Marches a ray to a lining as built.
    fn march_to_lining(&self, lining: &Lining, d: &Vector3<f64>) -> WallHit {
        let length = d.norm();
        let d = d / length;
        let point_at = |distance_m: f64, _: f64| {
            let point = self.t + d * distance_m;
            RayPoint {
                distance_m,
                point,
                beyond: lining.beyond(&point),
            }
        };
        let wall = match self.march(&d, lining.radius_m / 3.0, point_at) {
            None => return WallHit::NONE,
            Some([inside, outside]) => match &lining.segments {
                None => find_crossing(inside, outside, point_at),
                Some(rings) => {
                    let within = [inside.distance_m, outside.distance_m];
                    let joints = rings.joints_crossed(&self.t, &d, within);
                    self.first_crossing(lining, &d, within, &joints)
                }
            },
        };
        let RayPoint {
            point, distance_m, ..
        } = wall;
        WallHit {
            theta: point.x.atan2(point.z).rem_euclid(TAU),
            h_m: point.y,
            lambda: distance_m / length,
        }
    }

    /// Finds where a ray of unit direction `d` first leaves a lining of segments between two
    /// distances, metres, of which the second is beyond; in between it crosses joints.
    ///
    /// From joint to joint the wall is smooth. A ray that has left the inside when it crosses a
    /// joint meets the side of the next segment there.
    fn first_crossing(
        &self,
        lining: &Lining,
        d: &Vector3<f64>,
        [mut from_m, last_m]: [f64; 2],
        joints_m: &[f64],
    ) -> RayPoint {
        for to_m in joints_m.iter().copied().chain([last_m]) {
            let middle = self.t + d * (0.5 * (from_m + to_m));
            let step_m = lining.step_m(middle.x.atan2(middle.z), middle.y);
            let point_at = |distance_m: f64, _: f64| {
                let point = self.t + d * distance_m;
                RayPoint {
                    distance_m,
                    point,
                    beyond: lining.beyond_with_step(step_m, &point),
                }
            };
            let [from, to] = [from_m, to_m].map(|distance_m| point_at(distance_m, 0.0));
            if from.beyond >= 0.0 {
                return from;
            }
            if to.beyond >= 0.0 {
                return find_crossing(from, to, point_at);
            }
            from_m = to_m;
        }
        RayPoint {
            distance_m: last_m,
            point: self.t + d * last_m,
            beyond: 0.0,
        }
    }

    /// Marches a ray to the wall of a section swept along a line.
    fn march_to_section(
        &self,
        section: &CrossSection,
        line: Option<&Centreline>,
        d: &Vector3<f64>,
    ) -> WallHit {
        let length = d.norm();
        let d = d / length;
        let point_at = |distance_m: f64, near_h_m: f64| {
            let point = Tunnel::section_coordinates(line, &(self.t + d * distance_m), near_h_m);
            let beyond = section.g(point.x, point.z) - 1.0;
            RayPoint {
                distance_m,
                point,
                beyond,
            }
        };
        let Some([inside, outside]) = self.march(&d, section.nearest_m() / 3.0, point_at) else {
            return WallHit::NONE;
        };
        let wall = find_crossing(inside, outside, point_at);
        WallHit {
            theta: section.angle_of(wall.point.x, wall.point.z),
            h_m: wall.point.y,
            lambda: wall.distance_m / length,
        }
    }

    /// Marches a ray of unit direction `d` in steps of `step_m` until it leaves the inside: returns
    /// the last point inside and the first beyond; None if there is none.
    fn march(
        &self,
        d: &Vector3<f64>,
        step_m: f64,
        point_at: impl Fn(f64, f64) -> RayPoint,
    ) -> Option<[RayPoint; 2]> {
        let mut inside = point_at(0.0, self.h_m);
        // Chainage grows from step to step about as it did before.
        let mut growth_m = step_m * self.along.dot(d);
        let steps = |reach_m: f64| (reach_m / step_m) as usize + 1;
        for _ in 0..self.reach_m.map_or(MAX_RAY_STEPS, steps) {
            let next = point_at(inside.distance_m + step_m, inside.point.y + growth_m);
            if next.beyond >= 0.0 {
                return Some([inside, next]);
            }
            growth_m = next.point.y - inside.point.y;
            inside = next;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::as_built::{AsBuilt, Segments};
    use crate::options::SimulateOptions;
    use tunnelstitch_core::survey::TunnelSection;

    fn segmented(step_mm: f64) -> Tunnel {
        let as_built = AsBuilt {
            segments: Some(Segments {
                count: 6,
                ring_length_m: 0.5,
                step_mm,
                joint_mm: 0.0,
            }),
            ..AsBuilt::default()
        };
        let options = SimulateOptions {
            tunnel: TunnelSection::round(3.0),
            as_built,
            ..SimulateOptions::free()
        };
        Tunnel::new(&options).unwrap()
    }

    /// Rays in many directions, none along the axis.
    fn directions() -> impl Iterator<Item = Vector3<f64>> {
        (0..400).map(f64::from).map(|k| {
            let (sin, cos) = (2.3 * k).sin_cos();
            Vector3::new(sin, 1.2 * (0.9 * k).sin(), cos).normalize()
        })
    }

    /// On a segment the wall is a cylinder, whose intersection has a closed form.
    #[test]
    fn a_ray_meets_the_cylinder_of_its_segment() {
        let tunnel = segmented(3.0);
        let lining = tunnel.lining().unwrap();
        let t = Vector3::new(0.4, 0.2, -0.6);
        let caster = RayCaster::new(&tunnel, t);
        let mut on_joints = 0;
        for d in directions() {
            let hit = caster.intersect(&d);
            let cylinder = Tunnel::Round(3.0 + lining.deviation_m(hit.theta, hit.h_m));
            let there = RayCaster::new(&cylinder, t).intersect(&d);
            let is_same =
                (there.theta - hit.theta).abs() < 1e-9 && (there.h_m - hit.h_m).abs() < 1e-9;
            on_joints += usize::from(!is_same);
        }
        // Few rays meet the sides of segments, which are some millimetres high.
        assert!(on_joints < 8, "{on_joints}");
    }

    /// Steps of 2 cm, so that sides of segments are met as well.
    #[test]
    fn a_ray_meets_the_first_segment_on_its_way() {
        let tunnel = segmented(20.0);
        let lining = tunnel.lining().unwrap();
        let t = Vector3::new(0.4, 0.2, -0.6);
        let caster = RayCaster::new(&tunnel, t);
        for d in directions() {
            let WallHit { theta, h_m, .. } = caster.intersect(&d);
            let step_m = 1e-4;
            let first = (10_000..).map(|k| t + d * (f64::from(k) * step_m));
            let first = first.into_iter().find(|point| lining.beyond(point) >= 0.0);
            let first = first.unwrap();
            let aside = (first.x.atan2(first.z) - theta).sin().abs();
            assert!(
                aside < step_m && (first.y - h_m).abs() < 2.0 * step_m,
                "{d}"
            );
        }
    }

    /// The point at λ lies on the wall at its angle and chainage, for rays of any length.
    #[test]
    fn lambda_is_the_position_on_the_ray() {
        // The sides of segments lie between their radii.
        for (tunnel, tolerance) in [(segmented(3.0), 1e-2), (Tunnel::Round(3.0), 1e-9)] {
            let t = Vector3::new(0.4, 0.2, -0.6);
            let caster = RayCaster::new(&tunnel, t);
            for d in directions().map(|d| 2.5 * d) {
                let hit = caster.intersect(&d);
                let point = t + d * hit.lambda;
                assert!((point.y - hit.h_m).abs() < 1e-9);
                assert!((point.x.atan2(point.z) - hit.theta).sin().abs() < 1e-9);
                assert!((tunnel.radial_position(&point).0 - 1.0).abs() < tolerance);
            }
        }
    }

    #[test]
    fn with_a_reach_every_ray_ends() {
        for tunnel in [segmented(3.0), Tunnel::Round(3.0)] {
            let caster = RayCaster::new(&tunnel, Vector3::new(0.4, 0.2, -0.6));
            let near = directions().map(|d| caster.intersect(&d).h_m);
            let caster = caster_with_reach(&tunnel);
            for (d, h_m) in directions().zip(near) {
                assert_eq!(caster.intersect(&d).h_m, h_m);
            }
            for d in [Vector3::y(), -Vector3::y(), Vector3::new(1e-3, -1.0, 0.0)] {
                let hit = caster.intersect(&d);
                assert_eq!(hit.h_m, 0.2 + 90.0 * d.y);
                assert!(hit.theta.is_finite() && hit.lambda.is_finite());
            }
        }
    }

    fn caster_with_reach(tunnel: &Tunnel) -> RayCaster<'_> {
        RayCaster::new(tunnel, Vector3::new(0.4, 0.2, -0.6)).with_reach(Some(90.0))
    }

    #[test]
    fn the_wall_stands_where_rays_from_the_axis_meet_it() {
        for tunnel in [segmented(3.0), Tunnel::Round(2.0)] {
            let caster = RayCaster::new(&tunnel, Vector3::new(0.0, 0.7, 0.0));
            for angle in [0.3, 2.0, 4.5] {
                let d = Vector3::new(f64::sin(angle), 0.0, f64::cos(angle));
                let hit = caster.intersect(&d);
                assert!((hit.theta - angle).abs() < 1e-12 && hit.h_m == 0.7);
                let wall_m = tunnel.wall_distance_m(angle, 0.7);
                let outward = |m: f64| tunnel.radial_position(&(d * m + caster.t)).0;
                assert!(outward(wall_m - 1e-6) < 1.0 && outward(wall_m + 1e-6) > 1.0);
            }
        }
    }
}
