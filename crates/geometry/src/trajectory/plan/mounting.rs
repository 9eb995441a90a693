//! The mounting of the camera on the carrier.

use crate::trajectory::pose::Pose;
use crate::trajectory::so3;
use nalgebra::Vector3;

/// The mounting of the camera on a carrier that rotates about the tunnel's axis. All zero: the lens
/// on the axis, looking straight at the wall, the image's right towards larger θ and its lower edge
/// towards larger chainage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mounting {
    /// Tilt of the optical axis towards larger chainage, radians.
    pub tilt_rad: f64,
    /// Clockwise rotation about the optical axis, radians: after a quarter turn, the image's right
    /// points towards larger chainage.
    pub roll_rad: f64,
    /// Distance of the lens from the axis of rotation in the carrier's direction, metres.
    pub arm_m: f64,
}

impl Mounting {
    /// The pose of the camera in the carrier, `x_carrier = T x_camera`: `R = R_x(−tilt) R_z(roll)`,
    /// `t = (0, 0, arm)`.
    pub fn camera_in_carrier(&self) -> Pose {
        let tilt = so3::exp(&Vector3::new(-self.tilt_rad, 0.0, 0.0));
        let roll = so3::exp(&Vector3::new(0.0, 0.0, self.roll_rad));
        Pose::new(tilt * roll, Vector3::new(0.0, 0.0, self.arm_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::plan::station::Station;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn it_looks_where_it_says() {
        let mounting = Mounting {
            tilt_rad: 0.3,
            roll_rad: FRAC_PI_2,
            arm_m: 0.5,
        };
        let station = Station {
            chainage_m: 2.0,
            angle_rad: FRAC_PI_2,
            offset_m: [0.0, 0.1],
        };
        let pose = station.carrier().after(&mounting.camera_in_carrier());
        let near = |a: Vector3<f64>, b: Vector3<f64>| assert!((a - b).norm() < 1e-12, "{a} {b}");
        near(pose.t_wc, Vector3::new(0.5, 2.0, 0.1));
        // Towards θ = 90°, which is +x, and ahead.
        near(
            pose.r_wc * Vector3::z(),
            Vector3::new(0.3f64.cos(), 0.3f64.sin(), 0.0),
        );
        // The picture's right is ahead.
        near(
            pose.r_wc * Vector3::x(),
            Vector3::new(-0.3f64.sin(), 0.3f64.cos(), 0.0),
        );
    }
}
