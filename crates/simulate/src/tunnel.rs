//! Shape of the simulated tunnel and its intersection with rays.
//!
//! A round straight tunnel has a closed form. In all others, as in one whose lining deviates from
//! it, the ray is marched until it leaves the inside, and the crossing is found by false position.
//! The centreline of a curved tunnel comes from [`tunnelstitch_geometry::surface`], since it is an
//! input; everything else is independent of it.

use crate::cross_section::CrossSection;
use crate::error::SimulateError;
use crate::lining::Lining;
use crate::options::{AsBuilt, SimulateOptions};
use crate::procedural_noise::RandomStream;
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
    AsBuilt(Lining),
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

/// Maximum iterations of false position.
const MAX_FALSE_POSITION_ITERATIONS: usize = 60;
/// Distance from the wall at which false position stops, as a share of that from the axis.
const WALL_TOLERANCE: f64 = 1e-11;
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
            let seed = RandomStream::Lining.seed(options.seed);
            return Ok(Self::AsBuilt(Lining::new(
                radius_m,
                &options.as_built,
                seed,
            )));
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

    /// Deviation of a lining from its nominal radius, metres.
    pub fn deviation_m(&self, theta: f64, h_m: f64) -> f64 {
        match self {
            Self::AsBuilt(lining) => lining.deviation_m(theta, h_m),
            Self::Round(_) | Self::Shaped { .. } => 0.0,
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
        match self.march(&d, lining.radius_m / 3.0, point_at) {
            Some(wall) => WallHit {
                theta: wall.x.atan2(wall.z).rem_euclid(TAU),
                h_m: wall.y,
            },
            None => WallHit::NONE,
        }
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
        match self.march(&d, section.nearest_m() / 3.0, point_at) {
            Some(wall) => WallHit {
                theta: section.angle_of(wall.x, wall.z),
                h_m: wall.y,
            },
            None => WallHit::NONE,
        }
    }

    /// Marches a ray of unit direction `d` in steps of `step_m` until it leaves the inside, and
    /// finds the crossing, in the coordinates of `point_at`; None if there is none.
    fn march(
        &self,
        d: &Vector3<f64>,
        step_m: f64,
        point_at: impl Fn(f64, f64) -> RayPoint,
    ) -> Option<Vector3<f64>> {
        let mut inside = point_at(0.0, self.h_m);
        // Chainage grows from step to step about as it did before.
        let mut growth_m = step_m * self.along.dot(d);
        for _ in 0..MAX_RAY_STEPS {
            let next = point_at(inside.distance_m + step_m, inside.point.y + growth_m);
            if next.beyond >= 0.0 {
                return Some(find_crossing(inside, next, point_at));
            }
            growth_m = next.point.y - inside.point.y;
            inside = next;
        }
        None
    }
}

/// Point of a ray.
#[derive(Clone, Copy)]
struct RayPoint {
    /// Distance from the camera, metres.
    distance_m: f64,
    /// Coordinates in the section at its chainage.
    point: Vector3<f64>,
    /// Relative distance beyond the wall; negative inside.
    beyond: f64,
}

/// Finds the wall between a point inside and one beyond by the Illinois variant of false position.
///
/// The residual of an end that is kept twice is halved.
fn find_crossing(
    mut inside: RayPoint,
    mut outside: RayPoint,
    point_at: impl Fn(f64, f64) -> RayPoint,
) -> Vector3<f64> {
    let mut wall = outside;
    let mut last = None;
    for _ in 0..MAX_FALSE_POSITION_ITERATIONS {
        let share = inside.beyond / (inside.beyond - outside.beyond);
        wall = point_at(
            inside.distance_m + share * (outside.distance_m - inside.distance_m),
            inside.point.y + share * (outside.point.y - inside.point.y),
        );
        if wall.beyond.abs() < WALL_TOLERANCE {
            break;
        }
        let is_inside = wall.beyond < 0.0;
        if last == Some(is_inside) {
            let other = if is_inside { &mut outside } else { &mut inside };
            other.beyond *= 0.5;
        }
        last = Some(is_inside);
        *(if is_inside { &mut inside } else { &mut outside }) = wall;
    }
    wall.point
}
