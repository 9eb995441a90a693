//! The planned path: a camera that looks at an angle to the axis of the tunnel.

use crate::options::{SIDE_VIEW_DEG, SimulateOptions};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;
use tunnelstitch_geometry::trajectory::so3;
use tunnelstitch_geometry::trajectory::{Pose, spiral};

/// The planned poses, as if the tunnel were straight along y.
///
/// With the view's angle β, `r_wc = R_y(k · turn) R_x(β − 90°)`: the camera is tilted about its x
/// axis, so that its optical axis has the angle β to the tunnel's axis, y. At 0 it looks forward
/// along the tunnel, and what is at θ = 0 appears above the middle of the picture.
pub(super) fn plan(options: &SimulateOptions) -> Vec<Pose> {
    let turn_rad = options.turn_deg.to_radians();
    let side = spiral(options.frames, options.advance_m, turn_rad);
    if options.view_deg == SIDE_VIEW_DEG {
        return side;
    }
    let tilt = so3::exp(&(Vector3::x() * (options.view_deg.to_radians() - FRAC_PI_2)));
    side.iter()
        .map(|pose| Pose::new(pose.r_wc * tilt, pose.t_wc))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn second(view_deg: f64, turn_deg: f64) -> Pose {
        let options = SimulateOptions {
            view_deg,
            turn_deg,
            ..SimulateOptions::free()
        };
        plan(&options)[1]
    }

    #[test]
    fn the_optical_axis_has_the_angle_to_the_tunnel_in_every_frame() {
        for view_deg in [0.0, 30.0, 90.0, 135.0] {
            let pose = second(view_deg, 40.0);
            let axis = pose.r_wc * Vector3::z();
            assert!((axis.angle(&Vector3::y()).to_degrees() - view_deg).abs() < 1e-9);
            assert_eq!(pose.t_wc, second(90.0, 40.0).t_wc);
        }
    }

    /// θ = 0 lies along z, which is up in the picture of a camera that looks forward.
    #[test]
    fn up_is_the_middle_of_the_wall_from_the_side() {
        let forward = second(0.0, 0.0);
        assert!((forward.r_wc * -Vector3::y() - Vector3::z()).norm() < 1e-12);
        let oblique = second(60.0, 40.0).r_wc * Vector3::x();
        assert!((oblique - second(90.0, 40.0).r_wc * Vector3::x()).norm() < 1e-12);
    }
}
