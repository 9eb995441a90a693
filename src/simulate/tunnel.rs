//! The simulated tunnel: which place of the wall a ray meets.
//!
//! Round straight tunnels have a closed form; all others are searched for the place where the ray
//! leaves the inside, by false position. The line along the middle of a curved tunnel is the
//! survey's, since it is a part of what is given; everything else is this module's own.

use super::outline::Outline;
use super::{SimulateError, SimulateOptions};
use crate::surface::Centreline;
use crate::survey::read_centreline;
use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// The tunnel.
pub(super) enum Tunnel {
    /// Straight and round, of a radius in metres.
    Round(f64),
    /// Anything else.
    Shaped {
        /// The section.
        outline: Outline,
        /// The line along its middle, if it is not the y axis.
        line: Option<Centreline>,
    },
}

/// A place on the wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Around the section: 2π once around, from z towards x.
    pub theta: f64,
    /// Chainage, metres.
    pub h_m: f64,
}

impl Place {
    /// Where a ray goes that the lens does not show.
    pub const NOWHERE: Self = Self {
        theta: f64::NAN,
        h_m: f64::NAN,
    };
}

/// Rounds of false position at the most.
const ROUNDS: usize = 60;
/// A place is on the wall if it is so close to it, shares of the distance from the axis.
const CLOSE: f64 = 1e-11;
/// Steps of a ray at the most.
const STEPS: usize = 2000;

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
            return Ok(Self::Round(radius_m));
        }
        let nominal_m = section.nominal_m();
        let width_m = 2.0 * nominal_m;
        let height_m = section.height_m.unwrap_or(width_m);
        let outline = Outline::new(section.shape, width_m, height_m);
        let line = match &section.centreline {
            Some(path) => {
                let points = read_centreline(path).map_err(|error| fail(error.to_string()))?;
                let line = Centreline::through(&points, nominal_m, outline.farthest_m());
                Some(line.map_err(|error| fail(format!("{}: {error}", path.display())))?)
            }
            None => None,
        };
        Ok(Self::Shaped { outline, line })
    }

    /// Length of the section's outline, metres.
    pub fn perimeter_m(&self) -> f64 {
        match self {
            Self::Round(radius_m) => TAU * radius_m,
            Self::Shaped { outline, .. } => outline.perimeter_m(),
        }
    }

    /// Least distance of the wall from the axis, metres.
    pub fn nearest_m(&self) -> f64 {
        match self {
            Self::Round(radius_m) => *radius_m,
            Self::Shaped { outline, .. } => outline.nearest_m(),
        }
    }

    /// A pose in the straight tunnel, carried over to where the tunnel really goes.
    pub fn bent(&self, pose: &Pose) -> Pose {
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

    /// A point as the section at its chainage sees it, of nominal size: x, chainage, z; the
    /// chainage is near `h_m`.
    fn local(line: Option<&Centreline>, point: &Vector3<f64>, h_m: f64) -> Vector3<f64> {
        let Some(line) = line else {
            return *point;
        };
        let h_m = line.refine_chainage_m(point, h_m);
        let at = line.at(h_m);
        let arm = at.frame.inverse_transform_vector(&(point - at.point)) / at.scale;
        Vector3::new(arm.x, h_m, arm.z)
    }

    /// How far towards the wall a point is: 0 on the axis, 1 on the wall; and its distance from the
    /// axis, metres.
    pub fn outward(&self, point: &Vector3<f64>) -> (f64, f64) {
        match self {
            Self::Round(radius_m) => {
                let distance_m = point.x.hypot(point.z);
                (distance_m / radius_m, distance_m)
            }
            Self::Shaped { outline, line } => {
                let line = line.as_ref();
                let h_m = line.map_or(0.0, |line| line.chainage_m(point));
                let local = Self::local(line, point, h_m);
                (outline.g(local.x, local.z), local.x.hypot(local.z))
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

    /// The direction of the tunnel at a point.
    pub fn along(&self, point: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Shaped {
                line: Some(line), ..
            } => line.at(line.chainage_m(point)).velocity.normalize(),
            _ => Vector3::y(),
        }
    }

    /// Where rays from `t` meet the wall.
    pub fn rays(&self, t: Vector3<f64>) -> Rays<'_> {
        Rays {
            tunnel: self,
            h_m: self.chainage_m(&t),
            along: self.along(&t),
            t,
        }
    }
}

/// Rays from one place.
pub(super) struct Rays<'a> {
    tunnel: &'a Tunnel,
    /// Where they start, metres.
    pub t: Vector3<f64>,
    h_m: f64,
    /// The direction of the tunnel there.
    along: Vector3<f64>,
}

impl Rays<'_> {
    /// The place that a ray of direction `d` meets; NaN if it meets none.
    #[inline]
    pub fn hit(&self, d: &Vector3<f64>) -> Place {
        match self.tunnel {
            Tunnel::Round(radius_m) => self.round(*radius_m, d),
            Tunnel::Shaped { outline, line } => self.search(outline, line.as_ref(), d),
        }
    }

    /// With `d̂ = d_xz/|d_xz|`, the way along it is `−t·d̂ + √(r² − (t × d̂)²)`: from the foot of
    /// the perpendicular on the axis's side to the circle.
    #[inline]
    fn round(&self, radius_m: f64, d: &Vector3<f64>) -> Place {
        let across = (d.x * d.x + d.z * d.z).sqrt();
        let (dx, dz) = (d.x / across, d.z / across);
        let foot = self.t.x * dx + self.t.z * dz;
        let aside = self.t.x * dz - self.t.z * dx;
        let way = (radius_m * radius_m - aside * aside).sqrt() - foot;
        let theta = (self.t.x + way * dx).atan2(self.t.z + way * dz);
        Place {
            theta: if theta < 0.0 { theta + TAU } else { theta },
            h_m: self.t.y + way / across * d.y,
        }
    }

    fn search(&self, outline: &Outline, line: Option<&Centreline>, d: &Vector3<f64>) -> Place {
        let d = d.normalize();
        let on_ray = |way_m: f64, near_h_m: f64| {
            let point = Tunnel::local(line, &(self.t + d * way_m), near_h_m);
            let beyond = outline.g(point.x, point.z) - 1.0;
            OnRay {
                way_m,
                point,
                beyond,
            }
        };
        let step_m = outline.nearest_m() / 3.0;
        let mut inside = on_ray(0.0, self.h_m);
        // Chainage grows from step to step about as it did before.
        let mut growth_m = step_m * self.along.dot(&d);
        for _ in 0..STEPS {
            let next = on_ray(inside.way_m + step_m, inside.point.y + growth_m);
            if next.beyond >= 0.0 {
                let wall = closed_in(inside, next, on_ray);
                return Place {
                    theta: outline.place(wall.x, wall.z),
                    h_m: wall.y,
                };
            }
            growth_m = next.point.y - inside.point.y;
            inside = next;
        }
        Place::NOWHERE
    }
}

/// A point of a ray.
#[derive(Clone, Copy)]
struct OnRay {
    /// Its distance from where the ray starts, metres.
    way_m: f64,
    /// As the section at its chainage sees it.
    point: Vector3<f64>,
    /// How far it lies beyond the wall, as a share of the distance from the axis; less than 0
    /// inside.
    beyond: f64,
}

/// Where a ray meets the wall between a point inside and one beyond: the rule of false position as
/// the Illinois algorithm has it, by which an end that stays counts half.
fn closed_in(
    mut inside: OnRay,
    mut outside: OnRay,
    on_ray: impl Fn(f64, f64) -> OnRay,
) -> Vector3<f64> {
    let mut wall = outside;
    let mut last = None;
    for _ in 0..ROUNDS {
        let share = inside.beyond / (inside.beyond - outside.beyond);
        wall = on_ray(
            inside.way_m + share * (outside.way_m - inside.way_m),
            inside.point.y + share * (outside.point.y - inside.point.y),
        );
        if wall.beyond.abs() < CLOSE {
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
