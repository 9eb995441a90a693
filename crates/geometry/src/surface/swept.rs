//! Curved tunnels: a section swept along a centreline.

use super::centreline::{Centreline, CentrelineFrame};
use super::error::SurfaceError;
use super::gauge::{Axis, Gauge};
use super::section::Section;
use super::shape::Surface;
use super::wall::{Hit, WallFrame, WallPoint};
use crate::trajectory::Pose;
use nalgebra::{Matrix3, Matrix6, SymmetricEigen, Vector2, Vector3, Vector6};

/// A section of scale `g(h)` swept along a line `c(h)` with frames `Q(h)`: the wall point is
/// `X(s, h) = c + Q (g x(s), 0, g z(s))`.
///
/// Source: W. Wang, B. Jüttler, D. Zheng, Y. Liu, "Computation of rotation minimizing frames", ACM
/// TOG 27(1), 2008 (sweep surfaces).
#[derive(Debug)]
pub struct Swept {
    section: Box<dyn Section>,
    line: Centreline,
    gauge: Gauge,
}

/// Step along a ray relative to the distance from the axis to the wall, while the ray is not close
/// to the wall.
const RAY_STEP: f64 = 0.25;
/// Largest number of steps along a ray; a ray that has not met the wall by then counts as parallel
/// to the tunnel.
const MAX_RAY_STEPS: usize = 4000;
/// Largest ratio of normal to total displacement of the wall for a gauge motion.
const GAUGE_TOLERANCE: f64 = 1e-4;
/// Sections, and points of each, at which gauge motions are tested.
const GAUGE_SAMPLES: (usize, usize) = (60, 24);

impl Swept {
    /// Creates the tunnel of a section along a line.
    pub fn new(section: Box<dyn Section>, line: Centreline) -> Self {
        let mut swept = Self {
            section,
            line,
            gauge: Gauge::default(),
        };
        swept.gauge = swept.find_gauge();
        swept
    }

    /// The centreline.
    pub fn line(&self) -> &Centreline {
        &self.line
    }

    /// Converts a point to the section's frame at nominal scale: x and z of `Qᵀ(p − c)/g`.
    fn local(at: &CentrelineFrame, point: &Vector3<f64>) -> Vector2<f64> {
        let arm = at.frame.inverse_transform_vector(&(point - at.point)) / at.scale;
        Vector2::new(arm.x, arm.z)
    }

    fn frame_at(&self, at: &CentrelineFrame, s_m: f64) -> WallFrame {
        let outline = self.section.at(s_m);
        let arm = Vector3::new(outline.point.x, 0.0, outline.point.y);
        let tangent = Vector3::new(outline.tangent.x, 0.0, outline.tangent.y);
        let growing = at.turn.cross(&arm) * at.scale + arm * at.growth;
        WallFrame {
            x_w: at.point + at.frame * (arm * at.scale),
            e_s: at.frame * (tangent * at.scale),
            e_h: at.velocity + at.frame * growing,
        }
    }

    /// Solves `X(s, h) = t + λ d` by Newton's method from a nearby start; None if it diverges.
    fn intersect_newton(
        &self,
        t: &Vector3<f64>,
        d: &Vector3<f64>,
        mut wall: WallPoint,
        mut range: f64,
    ) -> Option<Hit> {
        let size_m = self.section.farthest_m();
        let mut last = f64::INFINITY;
        for _ in 0..30 {
            let frame = self.frame(wall);
            let left = t + d * range - frame.x_w;
            let jacobian = Matrix3::from_columns(&[frame.e_s, frame.e_h, -d]);
            let step = jacobian.try_inverse()? * left;
            let distance = left.norm();
            if distance <= 1e-12 * size_m || (distance < 1e-9 * size_m && distance >= last) {
                let s_m = wall.s_m.rem_euclid(self.perimeter_m());
                let wall = WallPoint { s_m, ..wall };
                let x_w = frame.x_w;
                return (range > 0.0).then_some(Hit { range, x_w, wall });
            }
            last = distance;
            // Steps are limited to a fraction of the section, for corners of the outline and
            // grazing views.
            let shortened = (0.2 * size_m / step.fixed_rows::<2>(0).norm()).min(1.0);
            wall.s_m += shortened * step.x;
            wall.h_m += shortened * step.y;
            range += shortened * step.z;
        }
        None
    }

    /// Determines the gauge numerically: the motions `(ω, u)` whose velocity `ω × X + u` has no
    /// component along the wall's normal anywhere.
    ///
    /// With `a = (X × n, n)`, metres in multiples of the tunnel's size, they are the null vectors
    /// of `Σ a aᵀ`.
    fn find_gauge(&self) -> Gauge {
        let length_m = self.line.length_m();
        let middle = self.line.at(0.5 * length_m).point;
        let unit_m = (0.5 * length_m).max(self.section.farthest_m());
        let (sections, points) = GAUGE_SAMPLES;
        let mut normal = Matrix6::zeros();
        for k in 0..sections {
            let at = self.line.at((k as f64 + 0.5) / sections as f64 * length_m);
            for j in 0..points {
                let s_m = (j as f64 + 0.3) / points as f64 * self.perimeter_m();
                let frame = self.frame_at(&at, s_m);
                let n = frame.e_s.cross(&frame.e_h).normalize();
                let turned = ((frame.x_w - middle) / unit_m).cross(&n);
                let a = Vector6::new(turned.x, turned.y, turned.z, n.x, n.y, n.z);
                normal += a * a.transpose();
            }
        }
        let eigen = SymmetricEigen::new(normal / (sections * points) as f64);
        let free: Vec<Vector6<f64>> = (0..6)
            .filter(|k| eigen.eigenvalues[*k] < GAUGE_TOLERANCE * GAUGE_TOLERANCE)
            .map(|k| eigen.eigenvectors.column(k).into_owned())
            .collect();
        // Rotation (radians) and velocity (metres) of the world about its origin.
        let screw = |twist: &Vector6<f64>| {
            let omega: Vector3<f64> = twist.fixed_rows::<3>(0).into_owned() / unit_m;
            let velocity: Vector3<f64> = twist.fixed_rows::<3>(3).into_owned();
            (omega, velocity - omega.cross(&middle))
        };
        match &free[..] {
            [] => Gauge::default(),
            [twist] => {
                let (omega, velocity) = screw(twist);
                let rate = omega.norm();
                if rate * unit_m < GAUGE_TOLERANCE {
                    return Gauge {
                        axis: Axis {
                            point: middle,
                            direction: velocity.normalize(),
                        },
                        ..Gauge::straight()
                    };
                }
                let direction = omega / rate;
                Gauge {
                    axis: Axis {
                        point: omega.cross(&velocity) / (rate * rate),
                        direction,
                    },
                    turn: true,
                    pitch_m: direction.dot(&velocity) / rate,
                    shift: false,
                }
            }
            // A straight round tunnel in any pose.
            _ => Gauge {
                axis: Axis {
                    point: middle,
                    direction: self.line.at(0.5 * length_m).velocity.normalize(),
                },
                ..Gauge::round()
            },
        }
    }
}

impl Surface for Swept {
    /// Marches along the ray, each step as if the tunnel continued straight, until the ray is
    /// outside, and refines the intersection by Newton's method.
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError> {
        if !d.iter().all(|v| v.is_finite()) {
            return Err(SurfaceError::NotFinite);
        }
        self.check_inside(t)?;
        let speed = d.norm();
        if speed <= 0.0 {
            return Err(SurfaceError::Parallel);
        }
        let most = RAY_STEP * self.section.farthest_m() / speed;
        let mut range = 0.0;
        let mut h_m = self.chainage_m(t);
        for _ in 0..MAX_RAY_STEPS {
            let point = t + d * range;
            h_m = self.line.refine_chainage_m(&point, h_m);
            let at = self.line.at(h_m);
            let (local, ray) = (
                Self::local(&at, &point),
                at.frame.inverse_transform_vector(d) / at.scale,
            );
            let inside = self.section.contains(&local);
            let across = Vector2::new(ray.x, ray.z);
            let steep = across.norm_squared() <= 1e-18 * ray.norm_squared();
            let straight = match (inside, steep) {
                (true, false) => self.section.hit(&local, &across),
                // Just outside: the start is the wall point in the direction from the axis.
                _ => {
                    let s_m = self.section.hit(&Vector2::zeros(), &local).s_m;
                    let wall = WallPoint { s_m, h_m };
                    if !inside {
                        return self
                            .intersect_newton(t, d, wall, range)
                            .ok_or(SurfaceError::Parallel);
                    }
                    range += most * at.scale;
                    continue;
                }
            };
            if straight.range <= most * at.scale {
                let wall = WallPoint {
                    s_m: straight.s_m,
                    h_m: h_m + straight.range * ray.y * at.scale / at.velocity.norm(),
                };
                if let Some(hit) = self.intersect_newton(t, d, wall, range + straight.range) {
                    return Ok(hit);
                }
            }
            range += straight.range.clamp(1e-3 * most, most * at.scale);
        }
        Err(SurfaceError::Parallel)
    }

    fn frame(&self, wall: WallPoint) -> WallFrame {
        self.frame_at(&self.line.at(wall.h_m), wall.s_m)
    }

    /// Evaluates one point of the outline per column and one centreline frame per row.
    fn lattice(&self, s_m: &[f64], h_m: &[f64], points: &mut Vec<Vector3<f64>>) {
        let outline: Vec<Vector3<f64>> = (s_m.iter())
            .map(|s_m| self.section.at(*s_m).point)
            .map(|point| Vector3::new(point.x, 0.0, point.y))
            .collect();
        points.clear();
        for &h_m in h_m {
            let at = self.line.at(h_m);
            let rotation = at.frame.to_rotation_matrix().into_inner() * at.scale;
            points.extend(outline.iter().map(|arm| at.point + rotation * arm));
        }
    }

    fn perimeter_m(&self) -> f64 {
        self.section.perimeter_m()
    }

    fn gauge(&self) -> Gauge {
        self.gauge
    }

    fn chainage_m(&self, t: &Vector3<f64>) -> f64 {
        self.line.chainage_m(t)
    }

    fn straightened(&self, pose: &Pose) -> Pose {
        let h_m = self.chainage_m(&pose.t_wc);
        let at = self.line.at(h_m);
        let arm = at.frame.inverse_transform_vector(&(pose.t_wc - at.point));
        Pose::new(
            at.frame.inverse() * pose.r_wc,
            Vector3::new(arm.x, h_m, arm.z),
        )
    }

    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError> {
        if !t.iter().all(|v| v.is_finite()) {
            return Err(SurfaceError::NotFinite);
        }
        let at = self.line.at(self.chainage_m(t));
        let local = Self::local(&at, t);
        if self.section.contains(&local) {
            Ok(())
        } else {
            Err(SurfaceError::CameraOutside {
                distance_m: local.norm() * at.scale,
                wall_m: self.section.distance_m(&local) * at.scale,
            })
        }
    }

    fn angle_rad(&self, s_m: f64) -> f64 {
        super::section::angle_rad(self.section.as_ref(), s_m)
    }

    fn s_at_m(&self, angle_rad: f64) -> f64 {
        super::section::s_at_m(self.section.as_ref(), angle_rad)
    }
}

#[cfg(test)]
mod tests;
