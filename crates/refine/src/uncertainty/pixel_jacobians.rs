//! Derivatives of the wall point that a pixel shows, by pose, shared parameters and shape.

use crate::model::context::EstimationContext;
use crate::parameters::calibration::{BEND_INDEX, BEND_PARAMETERS, INTRINSIC_PARAMETERS};
use crate::uncertainty::total_covariance::{KappaJacobian, PixelJacobians};
use tunnelstitch_geometry::surface::{
    WallFrame, WallPoint, bend_jacobian, lens_jacobian, wall_jacobian,
};
use tunnelstitch_geometry::trajectory::Pose;

/// Derivatives of the wall point `wall` with tangents `frame`, seen through a fixed pixel from
/// `pose`.
pub fn pixel_jacobians(
    context: &EstimationContext,
    pose: &Pose,
    wall: WallPoint,
    frame: &WallFrame,
) -> PixelJacobians {
    let a = wall_jacobian(pose, frame);
    let x_c = pose.to_camera(&frame.x_w);
    let mut shared = KappaJacobian::zeros();
    shared
        .fixed_columns_mut::<INTRINSIC_PARAMETERS>(0)
        .copy_from(&lens_jacobian(pose, &a, &context.camera, &x_c));
    if context.calibration.free[BEND_INDEX] {
        let straightened = context.surface.straightened(pose);
        shared
            .fixed_columns_mut::<BEND_PARAMETERS>(BEND_INDEX)
            .copy_from(&bend_jacobian(pose, &straightened, &a, &x_c));
    }
    PixelJacobians {
        pose: a,
        shared,
        tau: -(a.fixed_columns::<3>(3) * context.nominal.frame(wall).normal()),
    }
}
