//! Straight tunnels of any section.

use super::error::SurfaceError;
use super::gauge::Gauge;
use super::section::Section;
use super::shape::{Surface, normals_of_straight};
use super::wall::{Hit, WallFrame, WallPoint};
use nalgebra::{Vector2, Vector3};

/// A section extruded along the world's y axis: the wall point is `(x(s), h, z(s))`.
#[derive(Debug)]
pub struct Prism {
    section: Box<dyn Section>,
}

impl Prism {
    /// Creates the tunnel of a section.
    pub fn new(section: Box<dyn Section>) -> Self {
        Self { section }
    }
}

impl Surface for Prism {
    /// Intersects the section with the ray projected along the axis.
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError> {
        if !d.iter().all(|v| v.is_finite()) {
            return Err(SurfaceError::NotFinite);
        }
        self.check_inside(t)?;
        let across = Vector2::new(d.x, d.z);
        if across.norm_squared() <= 1e-18 * d.norm_squared() {
            return Err(SurfaceError::Parallel);
        }
        let hit = self.section.hit(&Vector2::new(t.x, t.z), &across);
        let x_w = t + d * hit.range;
        Ok(Hit {
            range: hit.range,
            x_w,
            wall: WallPoint {
                s_m: hit.s_m,
                h_m: x_w.y,
            },
        })
    }

    fn frame(&self, wall: WallPoint) -> WallFrame {
        let at = self.section.at(wall.s_m);
        WallFrame {
            x_w: Vector3::new(at.point.x, wall.h_m, at.point.y),
            e_s: Vector3::new(at.tangent.x, 0.0, at.tangent.y),
            e_h: Vector3::y(),
        }
    }

    /// Evaluates one point of the outline per column.
    fn lattice(&self, s_m: &[f64], h_m: &[f64], points: &mut Vec<Vector3<f64>>) {
        let outline: Vec<Vector2<f64>> =
            s_m.iter().map(|s_m| self.section.at(*s_m).point).collect();
        points.clear();
        for &h_m in h_m {
            points.extend(
                outline
                    .iter()
                    .map(|point| Vector3::new(point.x, h_m, point.y)),
            );
        }
    }

    fn normals(&self, s_m: &[f64], h_m: &[f64], normals: &mut Vec<Vector3<f64>>) {
        normals_of_straight(self, s_m, h_m, normals);
    }

    fn perimeter_m(&self) -> f64 {
        self.section.perimeter_m()
    }

    fn gauge(&self) -> Gauge {
        if self.section.is_round() {
            Gauge::round()
        } else {
            Gauge::straight()
        }
    }

    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError> {
        if !t.iter().all(|v| v.is_finite()) {
            return Err(SurfaceError::NotFinite);
        }
        let point = Vector2::new(t.x, t.z);
        if self.section.contains(&point) {
            Ok(())
        } else {
            Err(SurfaceError::CameraOutside {
                distance_m: point.norm(),
                wall_m: self.section.distance_m(&point),
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
