//! Part of the wall that the frames see, and the resolution that they need.

use crate::camera_path::CameraPath;
use crate::error::SimulateError;
use crate::tunnel::Tunnel;
use crate::wall_intersection::{RayCaster, WallHit};
use std::f64::consts::TAU;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::Pose;

/// Maximum distance of simulated wall from a camera along the tunnel, radii.
const MAX_DISTANCE_RADII: f64 = 20.0;
/// Texels over the width of a pixel where the wall is nearest.
const TEXELS_PER_PIXEL: f64 = 3.0;
/// Maximum size of a texel, metres: finer than the joints of bricks.
const MAX_TEXEL_M: f64 = 0.004;

/// Minimum and maximum chainage that a frame sees, metres.
///
/// # Errors
/// [`SimulateError::CameraOutside`], [`SimulateError::LooksAlongTheAxis`].
pub(super) fn visible_chainage(
    frame: usize,
    path: &CameraPath,
    camera: &Camera,
    tunnel: &Tunnel,
) -> Result<[f64; 2], SimulateError> {
    let pose = &path.poses()[frame];
    let (outward, distance_m) = tunnel.radial_position(&pose.t_wc);
    if outward.is_nan() || outward >= 0.99 {
        return Err(SimulateError::CameraOutside { frame, distance_m });
    }
    let reach_m = MAX_DISTANCE_RADII * tunnel.perimeter_m() / TAU;
    let too_far = SimulateError::LooksAlongTheAxis { frame, reach_m };
    // The tunnel's vanishing points lie where its directions project to.
    let last = f64::from(camera.height - 1);
    let along = tunnel.direction_at(&pose.t_wc);
    for axis in [along, -along] {
        for row in [0.0, 0.5 * last, last] {
            let r_wc = path.pose_at_row(frame, row).r_wc;
            let x_c = r_wc.inverse_transform_vector(&axis);
            if let Some(pixel) = camera.project(&x_c)
                && camera.is_in_image(&pixel, -1.0)
            {
                return Err(too_far);
            }
        }
    }
    let mut visible = [f64::INFINITY, f64::NEG_INFINITY];
    // Without a vanishing point inside, h takes its extremes on the border.
    let border = camera.border(64, 0.5).into_iter();
    for (v, ray) in border.filter_map(|pixel| Some((pixel.y, camera.ray(pixel.x, pixel.y)?))) {
        let pose = path.pose_at_row(frame, v);
        let WallHit { h_m, .. } = RayCaster::new(tunnel, pose.t_wc).intersect(&(pose.r_wc * ray));
        if h_m.is_nan() {
            return Err(too_far);
        }
        visible = [visible[0].min(h_m), visible[1].max(h_m)];
    }
    // The border is sampled; a margin of 1 % covers its curvature between the samples.
    let margin_m = 0.01 * (visible[1] - visible[0]);
    let visible = [visible[0] - margin_m, visible[1] + margin_m];
    let camera_h_m = tunnel.chainage_m(&pose.t_wc);
    if visible.iter().all(|h_m| (h_m - camera_h_m).abs() < reach_m) {
        Ok(visible)
    } else {
        Err(too_far)
    }
}

/// Size of a texel, metres: a third of a pixel where a camera is nearest to the wall.
///
/// Cameras nearer to the wall than half the radius count as if they were at that distance.
pub(super) fn texel_size_m(tunnel: &Tunnel, camera: &Camera, truth: &[Pose]) -> f64 {
    let outward = truth
        .iter()
        .map(|pose| tunnel.radial_position(&pose.t_wc).0);
    let nearest_m = tunnel.nearest_m() * (1.0 - outward.fold(0.0, f64::max)).max(0.5);
    (nearest_m / camera.vertical_focal_px() / TEXELS_PER_PIXEL).min(MAX_TEXEL_M)
}
