//! Motion of the camera while a frame is exposed.

use crate::camera_path::CameraPath;
use crate::procedural_noise::RandomStream;
use crate::tunnel::Tunnel;
use crate::wall_intersection::RayCaster;
use nalgebra::Vector3;
use rand::Rng;
use std::f64::consts::TAU;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::{Pose, so3};

/// Sub-exposures for each pixel of the path, and their minimum and maximum.
const EXPOSURES_PER_PIXEL: f64 = 1.5;
const EXPOSURES: [f64; 2] = [3.0, 48.0];
/// Frames whose motion is measured.
const MEASURED_FRAMES: usize = 32;
/// Share of the time between frames, and angle (radians), over which motion is measured.
const STEP: f64 = 1e-3;
/// Maximum distance of the wall points by which motion is measured, radii.
const MAX_DISTANCE_RADII: f64 = 20.0;

/// Motion during an exposure, which moves wall points by a given mean path over the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotionBlur {
    kind: MotionKind,
    /// Number of sub-exposures.
    exposures: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum MotionKind {
    /// Along the path of the frames, for this share of the time between them.
    Path(f64),
    /// A turn by this angle, radians, about a random axis across the line of sight in each frame.
    Shake { angle_rad: f64, seed: u64 },
}

impl MotionBlur {
    /// Motion that moves wall points by `path_px` pixels (above 0) in the mean over the image and
    /// over all frames.
    ///
    /// The exposure time is the same for all frames. If they move by less than `path_px` from one
    /// to the next, no exposure is long enough, and the camera shakes instead.
    pub fn new(
        path_px: f64,
        seed: u64,
        path: &CameraPath,
        camera: &Camera,
        tunnel: &Tunnel,
    ) -> Self {
        let frames = path.poses().len();
        let stride = frames.div_ceil(MEASURED_FRAMES);
        let measured = || (0..frames).step_by(stride);
        let mean = |speed: &dyn Fn(usize) -> f64| {
            measured().map(speed).sum::<f64>() / measured().count() as f64 / STEP
        };
        let middle = 0.5 * f64::from(camera.height - 1);
        let along = mean(&|frame| {
            let [from, to] = [0.0, STEP].map(|delay| path.pose_at_row(frame, middle, delay));
            mean_motion_px(camera, tunnel, &from, &to)
        });
        let kind = if along >= path_px {
            MotionKind::Path(path_px / along)
        } else {
            let turning = mean(&|frame| {
                let pose = path.poses()[frame];
                let turns = [Vector3::x(), Vector3::y()];
                let moved = turns.map(|axis| {
                    mean_motion_px(camera, tunnel, &pose, &turned(&pose, &(axis * STEP)))
                });
                0.5 * (moved[0] + moved[1])
            });
            MotionKind::Shake {
                angle_rad: if turning > 0.0 {
                    path_px / turning
                } else {
                    0.0
                },
                seed,
            }
        };
        let exposures = (EXPOSURES_PER_PIXEL * path_px).ceil();
        Self {
            kind,
            exposures: exposures.clamp(EXPOSURES[0], EXPOSURES[1]) as usize,
        }
    }

    /// Times of the sub-exposures, from −½ to ½ of the exposure.
    pub fn times(&self) -> Vec<f64> {
        let time = |k: usize| (k as f64 + 0.5) / self.exposures as f64 - 0.5;
        (0..self.exposures).map(time).collect()
    }

    /// The pose of a frame at row `v` and a time within the exposure, after a delay (share of the
    /// time between frames).
    pub fn pose(&self, path: &CameraPath, frame: usize, v: f64, delay: f64, time: f64) -> Pose {
        match self.kind {
            MotionKind::Path(share) => path.pose_at_row(frame, v, delay + time * share),
            MotionKind::Shake { angle_rad, seed } => {
                let mut rng = RandomStream::MotionBlur.rng(seed, frame);
                let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
                let turn = Vector3::new(cos, sin, 0.0) * (angle_rad * time);
                turned(&path.pose_at_row(frame, v, delay), &turn)
            }
        }
    }
}

/// A pose turned by a rotation vector in the camera's frame, radians.
fn turned(pose: &Pose, turn: &Vector3<f64>) -> Pose {
    Pose::new(pose.r_wc * so3::exp(turn), pose.t_wc)
}

/// Mean distance by which wall points move over the image from one pose to another, pixels.
fn mean_motion_px(camera: &Camera, tunnel: &Tunnel, from: &Pose, to: &Pose) -> f64 {
    let reach_m = MAX_DISTANCE_RADII * tunnel.perimeter_m() / TAU;
    let caster = RayCaster::new(tunnel, from.t_wc).with_reach(Some(reach_m));
    let moved = camera.grid_rays().into_iter().filter_map(|ray| {
        let d = from.r_wc * ray;
        let hit = caster.intersect(&d);
        if (hit.h_m - caster.h_m).abs() >= reach_m {
            return None;
        }
        let seen = camera.project(&to.to_camera(&(from.t_wc + d * hit.lambda)))?;
        Some((seen - camera.project(&ray)?).norm())
    });
    let (sum, count) = moved.fold((0.0, 0), |(sum, count), px| (sum + px, count + 1));
    if count == 0 {
        0.0
    } else {
        sum / f64::from(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::spiral;

    const CAMERA: fn() -> Camera = || Camera::from_vertical_fov(160, 120, 1.0);

    fn blur(turn_rad: f64, path_px: f64) -> (MotionBlur, CameraPath) {
        let path = CameraPath::new(spiral(6, 0.0, turn_rad), 0.0, 120);
        let blur = MotionBlur::new(path_px, 3, &path, &CAMERA(), &Tunnel::Round(3.0));
        (blur, path)
    }

    /// From the axis, turning by α moves the point ahead by f tan α.
    #[test]
    fn points_move_by_about_the_given_path() {
        for turn_rad in [0.4, 0.0] {
            let (blur, path) = blur(turn_rad, 5.0);
            let is_shake = matches!(blur.kind, MotionKind::Shake { .. });
            assert_eq!(is_shake, turn_rad == 0.0);
            let ends = [-0.5, 0.5].map(|time| blur.pose(&path, 2, 60.0, 0.0, time));
            let angle = (ends[0].r_wc * Vector3::z()).angle(&(ends[1].r_wc * Vector3::z()));
            let moved_px = CAMERA().fy * angle.tan();
            assert!((3.5..6.0).contains(&moved_px), "{moved_px}");
            let mean_px = mean_motion_px(&CAMERA(), &Tunnel::Round(3.0), &ends[0], &ends[1]);
            assert!((mean_px - 5.0).abs() < 0.6, "{mean_px}");
        }
    }

    #[test]
    fn exposures_are_spread_evenly_about_the_middle() {
        let (blur, path) = blur(0.4, 5.0);
        let times = blur.times();
        assert_eq!(times.len(), 8);
        assert!(times.iter().sum::<f64>().abs() < 1e-12);
        assert!((times[1] - times[0] - 0.125).abs() < 1e-12);
        let middle = blur.pose(&path, 2, 60.0, 0.0, 0.0);
        assert!(middle.r_wc.angle_to(&path.poses()[2].r_wc) < 1e-12);
    }

    #[test]
    fn a_camera_that_stands_shakes_in_another_direction_in_every_frame() {
        let (blur, path) = blur(0.0, 5.0);
        let axis = |frame| {
            let pose = blur.pose(&path, frame, 60.0, 0.0, 0.5);
            (path.poses()[frame].r_wc.inverse() * pose.r_wc).scaled_axis()
        };
        assert!(axis(1).angle(&axis(2)) > 0.1);
        assert!(axis(1).z.abs() < 1e-12);
    }
}
