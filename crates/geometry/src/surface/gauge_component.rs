//! The component of a wall displacement that a gauge motion explains.

use super::displacement::wall_jacobian;
use super::gauge::GaugeMotion;
use super::shape::Surface;
use crate::trajectory::Pose;
use nalgebra::{Vector2, Vector3};

/// The component of a wall displacement `(Δs, Δh)`, metres, that a gauge motion explains, and that
/// motion.
///
/// On a straight tunnel the rotation displaces the wall along s and the translation along h. A
/// rotation that is free by itself displaces it in one direction, evaluated at the wall point on
/// the optical axis of the camera at `pose`.
pub fn gauge_component(
    surface: &dyn Surface,
    pose: &Pose,
    moved: &Vector2<f64>,
) -> (Vector2<f64>, GaugeMotion) {
    let gauge = surface.gauge();
    if gauge.turn && !gauge.shift {
        let hit = surface.hit(&pose.t_wc, &(pose.r_wc * Vector3::z())).ok();
        let per_radian = hit.map(|hit| {
            let wall = surface.frame(hit.wall);
            wall_jacobian(pose, &wall) * gauge.directions(pose)[0]
        });
        let per_radian = per_radian.unwrap_or_default();
        let square = per_radian.norm_squared();
        let turn_rad = if square > 0.0 {
            per_radian.dot(moved) / square
        } else {
            0.0
        };
        return (per_radian * turn_rad, gauge.motion(turn_rad, 0.0));
    }
    let radius_m = surface.perimeter_m() / std::f64::consts::TAU;
    let motion = gauge.motion(moved.x / radius_m, moved.y);
    (
        Vector2::new(motion.turn_rad * radius_m, motion.shift_m),
        motion,
    )
}
