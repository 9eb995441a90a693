//! Wall coordinates and distance of a measured point.

use super::shape::Surface;
use super::wall::WallPoint;
use crate::trajectory::Pose;
use nalgebra::Vector3;

/// Steps at the most; three or four suffice for points near a smooth wall.
const MAX_STEPS: usize = 20;
/// Step below which the foot point has converged, share of the perimeter.
const CONVERGED: f64 = 1e-10;

/// The point of a wall whose normal goes through a point in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootPoint {
    /// The point of the wall.
    pub wall: WallPoint,
    /// Distance of the point in space along the wall's normal, metres, positive outwards.
    pub distance_m: f64,
}

/// Chainage of a point (world, metres), and its vector from the tunnel's axis in its section.
pub fn from_axis(surface: &dyn Surface, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let straight = surface.straightened(&Pose::new(Default::default(), *point));
    let across = Vector3::new(straight.t_wc.x, 0.0, straight.t_wc.z);
    (straight.t_wc.y, straight.r_wc.inverse() * across)
}

/// Finds the foot point of `point` (world, metres): `X(s, h) + d n(s, h) = point`.
///
/// Starts where the ray from the tunnel's axis through the point meets the wall, in the section of
/// the point, and steps by the residual along the tangents. None for a point on the axis, one that
/// is not finite, and one for which that does not converge: near an edge of the wall it has no foot
/// point, or several.
pub fn foot_point(surface: &dyn Surface, point: &Vector3<f64>) -> Option<FootPoint> {
    let (_, outwards) = from_axis(surface, point);
    let hit = surface.hit(&(point - outwards), &outwards).ok()?;
    let mut wall = hit.wall;
    let converged_m = CONVERGED * surface.perimeter_m();
    for _ in 0..MAX_STEPS {
        let frame = surface.frame(wall);
        let normal = frame.normal();
        let residual = point - frame.x_w;
        let ds_m = residual.dot(&frame.e_s) / frame.e_s.norm_squared();
        let dh_m = residual.dot(&frame.e_h) / frame.e_h.norm_squared();
        if !(ds_m.is_finite() && dh_m.is_finite()) {
            return None;
        }
        if ds_m.abs() + dh_m.abs() < converged_m {
            wall.s_m = wall.s_m.rem_euclid(surface.perimeter_m());
            return Some(FootPoint {
                wall,
                distance_m: residual.dot(&normal),
            });
        }
        wall.s_m += ds_m;
        wall.h_m += dh_m;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::bend::Bend;
    use crate::surface::bent::bent;
    use crate::surface::circle::Circle;
    use crate::surface::prism::Prism;
    use crate::surface::section::{Ellipse, PiecewiseOutline};
    use std::sync::Arc;

    fn assert_found(surface: &dyn Surface, at: WallPoint, distance_m: f64) {
        let frame = surface.frame(at);
        let point = frame.x_w + frame.normal() * distance_m;
        let foot = foot_point(surface, &point).unwrap();
        assert!((foot.distance_m - distance_m).abs() < 1e-9, "{foot:?}");
        assert!((foot.wall.s_m - at.s_m).abs() < 1e-7, "{foot:?} {at:?}");
        assert!((foot.wall.h_m - at.h_m).abs() < 1e-7, "{foot:?} {at:?}");
    }

    #[test]
    fn points_off_a_wall_have_their_foot_point_on_it() {
        let circle: Arc<dyn Surface> = Arc::new(Circle::new(3.0).unwrap());
        let bend = Bend {
            curvature_per_m: [0.01, -0.02],
            at_h_m: 1.0,
        };
        let surfaces = [
            Arc::clone(&circle),
            bent(&circle, Some(bend)),
            Arc::new(Prism::new(Box::new(Ellipse::new(5.0, 6.5).unwrap()))),
            Arc::new(Prism::new(Box::new(
                PiecewiseOutline::horseshoe(5.0, 4.0).unwrap(),
            ))),
        ];
        for surface in surfaces {
            for (s_m, h_m) in [(0.3, 0.0), (4.0, 7.0), (7.5, -3.0)] {
                for distance_m in [-0.3, 0.0, 0.2] {
                    assert_found(surface.as_ref(), WallPoint { s_m, h_m }, distance_m);
                }
            }
        }
    }

    #[test]
    fn points_without_a_foot_point_have_none() {
        let circle = Circle::new(3.0).unwrap();
        assert_eq!(foot_point(&circle, &Vector3::new(0.0, 1.0, 0.0)), None);
        assert_eq!(foot_point(&circle, &Vector3::new(f64::NAN, 1.0, 0.0)), None);
    }
}
