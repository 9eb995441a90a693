//! Part of the wall that the frames see, and the resolution that they need.

use crate::error::SimulateError;
use crate::fog::Fog;
use crate::frame_motion::FrameMotion;
use crate::tunnel::Tunnel;
use crate::wall_intersection::{RayCaster, WallHit};
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::Pose;

/// Maximum distance of simulated wall from a camera along the tunnel without fog, radii.
pub(super) const MAX_DISTANCE_RADII: f64 = 20.0;
/// Texels over the width of a pixel where the wall is nearest.
const TEXELS_PER_PIXEL: f64 = 3.0;
/// Maximum size of a texel, metres: finer than the joints of bricks.
const MAX_TEXEL_M: f64 = 0.004;

/// Points along each edge of an image at which its border is sampled.
const BORDER_POINTS: usize = 64;

/// Minimum and maximum chainage that a frame sees, metres; with fog, up to the end of sight.
///
/// # Errors
/// [`SimulateError::CameraOutside`]; without fog, [`SimulateError::LooksAlongTheAxis`].
pub(super) fn visible_chainage(
    frame: usize,
    motion: &FrameMotion,
    camera: &Camera,
    tunnel: &Tunnel,
    fog: Option<Fog>,
) -> Result<[f64; 2], SimulateError> {
    let pose = &motion.poses()[frame];
    let (outward, distance_m) = tunnel.radial_position(&pose.t_wc);
    if outward.is_nan() || outward >= 0.99 {
        return Err(SimulateError::CameraOutside { frame, distance_m });
    }
    let camera_h_m = tunnel.chainage_m(&pose.t_wc);
    if let Some(fog) = fog {
        return Ok(chainage_up_to_fog(frame, motion, camera, tunnel, fog));
    }
    let reach_m = MAX_DISTANCE_RADII * tunnel.perimeter_m() / TAU;
    let too_far = SimulateError::LooksAlongTheAxis { frame, reach_m };
    // The tunnel's vanishing points lie where its directions project to.
    let last = f64::from(camera.height - 1);
    let along = tunnel.direction_at(&pose.t_wc);
    for axis in [along, -along] {
        if [0.0, 0.5 * last, last]
            .into_iter()
            .flat_map(|row| motion.outermost_poses(frame, row))
            .any(|pose| shows_direction(camera, &pose, &axis))
        {
            return Err(too_far);
        }
    }
    let mut visible = [f64::INFINITY, f64::NEG_INFINITY];
    // Without a vanishing point inside, h takes its extremes on the border.
    let border = camera.border(BORDER_POINTS, 0.5).into_iter();
    for (v, ray) in border.filter_map(|pixel| Some((pixel.y, camera.ray(pixel.x, pixel.y)?))) {
        for pose in motion.outermost_poses(frame, v) {
            let caster = RayCaster::new(tunnel, pose.t_wc);
            let WallHit { h_m, .. } = caster.intersect(&(pose.r_wc * ray));
            if h_m.is_nan() {
                return Err(too_far);
            }
            visible = [visible[0].min(h_m), visible[1].max(h_m)];
        }
    }
    let visible = with_margin(visible);
    if visible.iter().all(|h_m| (h_m - camera_h_m).abs() < reach_m) {
        Ok(visible)
    } else {
        Err(too_far)
    }
}

/// Minimum and maximum chainage that a frame sees in fog, metres.
///
/// Where a vanishing point of the axis lies in the image, that is the end of sight on its side.
fn chainage_up_to_fog(
    frame: usize,
    motion: &FrameMotion,
    camera: &Camera,
    tunnel: &Tunnel,
    fog: Fog,
) -> [f64; 2] {
    let mut visible = [f64::INFINITY, f64::NEG_INFINITY];
    let mut see = |h_m: f64| visible = [visible[0].min(h_m), visible[1].max(h_m)];
    for pixel in camera.border(BORDER_POINTS, 0.5) {
        for pose in motion.outermost_poses(frame, pixel.y) {
            let caster = RayCaster::new(tunnel, pose.t_wc).with_reach(Some(fog.reach_m));
            if let Some(ray) = camera.ray(pixel.x, pixel.y) {
                see(caster.intersect(&(pose.r_wc * ray)).h_m);
            }
            let along = tunnel.direction_at(&pose.t_wc);
            for side in [1.0, -1.0] {
                // In a bend, the farthest wall lies beside the vanishing point.
                if !tunnel.is_straight() || shows_direction(camera, &pose, &(along * side)) {
                    see(caster.h_m + side * fog.reach_m);
                }
            }
        }
    }
    with_margin(visible)
}

/// True if the image of a camera with the given pose, or a margin of a pixel around it, shows what
/// lies infinitely far in a direction.
fn shows_direction(camera: &Camera, pose: &Pose, direction: &Vector3<f64>) -> bool {
    let x_c = pose.r_wc.inverse_transform_vector(direction);
    let pixel = camera.project(&x_c);
    pixel.is_some_and(|pixel| camera.is_in_image(&pixel, -1.0))
}

/// A range with a margin of 1 %, which covers the border's curvature between the points at which it
/// is sampled.
fn with_margin([from_m, to_m]: [f64; 2]) -> [f64; 2] {
    let margin_m = 0.01 * (to_m - from_m);
    [from_m - margin_m, to_m + margin_m]
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
