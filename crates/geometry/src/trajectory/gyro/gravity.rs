//! The carrier's attitude about the tunnel's axis, from the direction of gravity.

use crate::trajectory::plan::Mounting;
use nalgebra::{UnitQuaternion, Vector3};

/// The carrier's attitude angle θ about the tunnel's axis from gravity. The carrier's y axis is
/// assumed to lie along the tunnel's axis, as in the plan, and the tunnel's bottom at `down_rad`.
///
/// `up_c` is the acceleration at rest in the camera's axes. With `u = R_mount up_c`, θ makes
/// `R_y(θ) u`, seen along the axis, point away from the bottom:
/// `θ = atan2(−sin d, −cos d) − atan2(u_x, u_z)`.
///
/// Returns `None` if gravity is within 10° of the axis, where the angle is unobservable.
pub fn angle_from_gravity_rad(
    up_c: &Vector3<f64>,
    mounting: &Mounting,
    down_rad: f64,
) -> Option<f64> {
    let up = mounting.camera_in_carrier().r_wc * up_c.try_normalize(1e-9)?;
    let across = up.x.hypot(up.z);
    (across > 10f64.to_radians().sin())
        .then(|| (-down_rad.sin()).atan2(-down_rad.cos()) - up.x.atan2(up.z))
}

/// The carrier's axis of rotation in camera coordinates: `R_mountᵀ y`.
pub fn axis_in_camera(mounting: &Mounting) -> Vector3<f64> {
    let r: UnitQuaternion<f64> = mounting.camera_in_carrier().r_wc;
    r.inverse() * Vector3::y()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::plan::Station;
    use std::f64::consts::TAU;

    #[test]
    fn gravity_gives_the_angle_about_the_axis() {
        let mounting = Mounting {
            tilt_rad: 0.2,
            roll_rad: -0.4,
            arm_m: 0.1,
        };
        for (angle_rad, down_rad) in [(0.3, 0.0), (-2.0, 1.0), (4.0, -3.0)] {
            let station = Station {
                angle_rad,
                ..Station::default()
            };
            let camera = station.carrier().after(&mounting.camera_in_carrier());
            let up = Vector3::new(-f64::sin(down_rad), 0.0, -f64::cos(down_rad));
            let up_c = camera.r_wc.inverse() * up * 0.98;
            let found = angle_from_gravity_rad(&up_c, &mounting, down_rad).unwrap();
            let off = (found - angle_rad).rem_euclid(TAU);
            assert!(off.min(TAU - off) < 1e-9, "{found} {angle_rad}");
        }
        let along = Mounting::default();
        assert!(angle_from_gravity_rad(&Vector3::new(0.0, 1.0, 0.1), &along, 0.0).is_none());
    }
}
