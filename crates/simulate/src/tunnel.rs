//! Shape of the simulated tunnel and its intersection with rays.
//!
//! A round straight tunnel has a closed form. In all others, as in one whose lining deviates from
//! it, the ray is marched until it leaves the inside, and the crossing is found by false position.
//! The centreline of a curved tunnel comes from [`tunnelstitch_geometry::surface`], since it is an
//! input; everything else is independent of it.

use crate::as_built::AsBuilt;
use crate::cross_section::CrossSection;
use crate::error::SimulateError;
use crate::false_position::{RayPoint, find_crossing};
use crate::lining::lining::Lining;
use crate::options::SimulateOptions;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tunnelstitch_core::survey::read_centreline;
use tunnelstitch_geometry::surface::Centreline;
use tunnelstitch_geometry::trajectory::Pose;

/// Shape of the simulated tunnel.
pub(super) enum Tunnel {
    /// Straight and round, with its radius in metres.
    Round(f64),
    /// Straight and round, but for the deviations of its lining.
    AsBuilt(Box<Lining>),
    /// Any other cross-section or centreline.
    Shaped {
        /// The cross-section.
        section: CrossSection,
        /// The centreline, if it is not the y axis.
        line: Option<Centreline>,
    },
}

/// Point of the wall that a ray meets.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallHit {
    /// Arc length around the section as an angle: 2π once around, from z towards x.
    pub theta: f64,
    /// Chainage, metres.
    pub h_m: f64,
}

impl WallHit {
    /// Result for a ray that meets no wall.
    pub const NONE: Self = Self {
        theta: f64::NAN,
        h_m: f64::NAN,
    };
}

/// Maximum steps along a ray, each a third of the section's inner radius.
const MAX_RAY_STEPS: usize = 2000;

impl Tunnel {
    /// The tunnel of the options.
    ///
    /// # Errors
    /// [`SimulateError::Option`] for impossible sizes and lines.
    pub fn new(options: &SimulateOptions) -> Result<Self, SimulateError> {
        let section = &options.tunnel;
        let fail = |what: String| SimulateError::Option { what };
        section.section().map_err(fail)?;
        if let (true, Some(radius_m)) = (section.is_straight_and_round(), section.radius_m) {
            if options.as_built == AsBuilt::default() {
                return Ok(Self::Round(radius_m));
            }
            let lining = Lining::new(radius_m, &options.as_built, options.seed)?;
            return Ok(Self::AsBuilt(Box::new(lining)));
        }
        if options.as_built != AsBuilt::default() {
            return Err(fail(
                "a lining as built needs a straight round tunnel".to_owned(),
            ));
        }
        let nominal_m = section.nominal_m();
        let width_m = 2.0 * nominal_m;
        let height_m = section.height_m.unwrap_or(width_m);
        let outline = CrossSection::new(section.shape, width_m, height_m);
        let line = match &section.centreline {
            Some(path) => {
                let points = read_centreline(path).map_err(|error| fail(error.to_string()))?;
                let line = Centreline::through(&points, nominal_m, outline.farthest_m());
                Some(line.map_err(|error| fail(format!("{}: {error}", path.display())))?)
            }
            None => None,
        };
        Ok(Self::Shaped {
            section: outline,
            line,
        })
    }

    /// Length of the section's outline, metres.
    pub fn perimeter_m(&self) -> f64 {
        match self {
            Self::Round(radius_m) => TAU * radius_m,
            Self::AsBuilt(lining) => TAU * lining.radius_m,
            Self::Shaped { section, .. } => section.perimeter_m(),
        }
    }

    /// Minimum distance of the wall from the axis, metres.
    pub fn nearest_m(&self) -> f64 {
        match self {
            Self::Round(radius_m) => *radius_m,
            Self::AsBuilt(lining) => lining.radius_m,
            Self::Shaped { section, .. } => section.nearest_m(),
        }
    }

    /// Distance of the wall of a straight tunnel from its axis, metres, in the direction of the
    /// given angle (from z towards x) at a chainage.
    pub fn wall_distance_m(&self, angle: f64, h_m: f64) -> f64 {
        match self {
            Self::Round(radius_m) => *radius_m,
            Self::AsBuilt(lining) => lining.radius_m + lining.deviation_m(angle, h_m),
            Self::Shaped { section, .. } => 1.0 / section.g(angle.sin(), angle.cos()),
        }
    }

    /// True if the axis is a straight line.
    pub fn is_straight(&self) -> bool {
        !matches!(self, Self::Shaped { line: Some(_), .. })
    }

    /// The lining as built, if it deviates from the tunnel.
    pub fn lining(&self) -> Option<&Lining> {
        match self {
            Self::AsBuilt(lining) => Some(lining),
            _ => None,
        }
    }

    /// Transfers a pose in the straightened tunnel to the world.
    pub fn to_world(&self, pose: &Pose) -> Pose {
        let Self::Shaped {
            line: Some(line), ..
        } = self
        else {
            return *pose;
        };
        let at = line.at(pose.t_wc.y);
        let across = Vector3::new(pose.t_wc.x, 0.0, pose.t_wc.z);
        Pose::new(at.frame * pose.r_wc, at.point + at.frame * across)
    }

    /// Coordinates (x, chainage, z) of a world point in the section of nominal size at its
    /// chainage, which is near `h_m`.
    fn section_coordinates(
        line: Option<&Centreline>,
        point: &Vector3<f64>,
        h_m: f64,
    ) -> Vector3<f64> {
        let Some(line) = line else {
            return *point;
        };
        let h_m = line.refine_chainage_m(point, h_m);
        let at = line.at(h_m);
        let arm = at.frame.inverse_transform_vector(&(point - at.point)) / at.scale;
        Vector3::new(arm.x, h_m, arm.z)
    }

    /// Radial position of a point: relative (0 on the axis, 1 on the wall), and in metres.
    pub fn radial_position(&self, point: &Vector3<f64>) -> (f64, f64) {
        match self {
            Self::Round(radius_m) => {
                let distance_m = point.x.hypot(point.z);
                (distance_m / radius_m, distance_m)
            }
            Self::AsBuilt(lining) => (1.0 + lining.beyond(point), point.x.hypot(point.z)),
            Self::Shaped { section, line } => {
                let line = line.as_ref();
                let h_m = line.map_or(0.0, |line| line.chainage_m(point));
                let local = Self::section_coordinates(line, point, h_m);
                (section.g(local.x, local.z), local.x.hypot(local.z))
            }
        }
    }

    /// Chainage of a point, metres.
    pub fn chainage_m(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Shaped {
                line: Some(line), ..
            } => line.chainage_m(point),
            _ => point.y,
        }
    }

    /// Unit direction of the axis at a point.
    pub fn direction_at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Shaped {
                line: Some(line), ..
            } => line.at(line.chainage_m(point)).velocity.normalize(),
            _ => Vector3::y(),
        }
    }

    /// The ray caster for a camera at `t`.
    pub fn caster_at(&self, t: Vector3<f64>) -> RayCaster<'_> {
        RayCaster {
            tunnel: self,
            h_m: self.chainage_m(&t),
            along: self.direction_at(&t),
            t,
        }
    }
}

/// Intersection of rays from one camera centre with the wall.
pub(super) struct RayCaster<'a> {
    tunnel: &'a Tunnel,
    /// Camera centre, metres.
    pub t: Vector3<f64>,
    h_m: f64,
    /// Unit direction of the axis at the camera.
    along: Vector3<f64>,
}

impl RayCaster<'_> {
    /// Intersects a ray of direction `d` with the wall; NaN if it meets none.
    #[inline]
    pub fn intersect(&self, d: &Vector3<f64>) -> WallHit {
        match self.tunnel {
            Tunnel::Round(radius_m) => self.intersect_round(*radius_m, d),
            Tunnel::AsBuilt(lining) => self.march_to_lining(lining, d),
            Tunnel::Shaped { section, line } => self.march_to_section(section, line.as_ref(), d),
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
        }
    }

    /// Marches a ray to a lining as built.
    fn march_to_lining(&self, lining: &Lining, d: &Vector3<f64>) -> WallHit {
        let d = d.normalize();
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
        WallHit {
            theta: wall.x.atan2(wall.z).rem_euclid(TAU),
            h_m: wall.y,
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
    ) -> Vector3<f64> {
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
                return from.point;
            }
            if to.beyond >= 0.0 {
                return find_crossing(from, to, point_at);
            }
            from_m = to_m;
        }
        self.t + d * last_m
    }

    /// Marches a ray to the wall of a section swept along a line.
    fn march_to_section(
        &self,
        section: &CrossSection,
        line: Option<&Centreline>,
        d: &Vector3<f64>,
    ) -> WallHit {
        let d = d.normalize();
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
            theta: section.angle_of(wall.x, wall.z),
            h_m: wall.y,
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
        for _ in 0..MAX_RAY_STEPS {
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
    use crate::as_built::Segments;
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
        let caster = tunnel.caster_at(t);
        let mut on_joints = 0;
        for d in directions() {
            let hit = caster.intersect(&d);
            let cylinder = Tunnel::Round(3.0 + lining.deviation_m(hit.theta, hit.h_m));
            let there = cylinder.caster_at(t).intersect(&d);
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
        let caster = tunnel.caster_at(t);
        for d in directions() {
            let WallHit { theta, h_m } = caster.intersect(&d);
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

    #[test]
    fn the_wall_stands_where_rays_from_the_axis_meet_it() {
        for tunnel in [segmented(3.0), Tunnel::Round(2.0)] {
            let caster = tunnel.caster_at(Vector3::new(0.0, 0.7, 0.0));
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
