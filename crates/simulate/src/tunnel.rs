//! Shape of the simulated tunnel.
//!
//! The centreline of a curved tunnel comes from [`tunnelstitch_geometry::surface`], since it is an
//! input; everything else is independent of it.

use crate::as_built::AsBuilt;
use crate::cross_section::CrossSection;
use crate::error::SimulateError;
use crate::lining::lining::Lining;
use crate::options::SimulateOptions;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tunnelstitch_core::survey::read_centreline;
use tunnelstitch_geometry::files::printed;
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
                Some(line.map_err(|error| fail(format!("{}: {error}", printed(path))))?)
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
    pub fn section_coordinates(
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

    /// Unit normal of the wall, towards the inside, at a point of it whose chainage is near `h_m`.
    ///
    /// It is the direction in which the relative distance beyond the wall falls fastest, by central
    /// differences but for a cylinder. At a joint it is that of one of the segments.
    pub fn inward_normal(&self, point: &Vector3<f64>, h_m: f64) -> Vector3<f64> {
        let step_m = 1e-5 * self.nearest_m();
        let gradient = |beyond: &dyn Fn(&Vector3<f64>) -> f64| {
            Vector3::from_fn(|k, _| {
                let step = Vector3::ith(k, step_m);
                beyond(&(point + step)) - beyond(&(point - step))
            })
        };
        let outward = match self {
            Self::Round(_) => Vector3::new(point.x, 0.0, point.z),
            Self::AsBuilt(lining) => {
                let segment_m = lining.step_m(point.x.atan2(point.z), point.y);
                gradient(&|point| lining.beyond_with_step(segment_m, point))
            }
            Self::Shaped { section, line } => gradient(&|point| {
                let local = Self::section_coordinates(line.as_ref(), point, h_m);
                section.g(local.x, local.z)
            }),
        };
        -outward.normalize()
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wall_intersection::RayCaster;
    use tunnelstitch_core::survey::{Shape, TunnelSection};

    /// The normal is perpendicular to the chords to neighbouring points of the wall.
    #[test]
    fn normals_are_perpendicular_to_the_wall() {
        let horseshoe = TunnelSection {
            shape: Shape::Horseshoe,
            radius_m: None,
            width_m: Some(5.0),
            height_m: Some(4.0),
            ..TunnelSection::round(1.0)
        };
        for (section, ovality_mm) in [
            (TunnelSection::round(3.0), 0.0),
            (TunnelSection::round(3.0), 60.0),
            (horseshoe, 0.0),
        ] {
            let options = SimulateOptions {
                tunnel: section,
                as_built: AsBuilt {
                    ovality_mm,
                    ..AsBuilt::default()
                },
                ..SimulateOptions::free()
            };
            let tunnel = Tunnel::new(&options).unwrap();
            let t = Vector3::new(0.3, 0.1, -0.2);
            let caster = RayCaster::new(&tunnel, t);
            let point = |angle: f64, rise: f64| {
                let d = Vector3::new(angle.sin(), rise, angle.cos());
                t + d * caster.intersect(&d).lambda
            };
            for angle in [0.3, 1.2, 3.0, 4.4] {
                let here = point(angle, 0.2);
                let normal = tunnel.inward_normal(&here, here.y);
                assert!((normal.norm() - 1.0).abs() < 1e-12);
                assert!(normal.dot(&(t - here)) > 0.0);
                for next in [point(angle + 1e-4, 0.2), point(angle, 0.2001)] {
                    let chord = (next - here).normalize();
                    assert!(normal.dot(&chord).abs() < 1e-3, "{angle}: {chord}");
                }
            }
        }
    }
}
