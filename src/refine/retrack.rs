//! Tracking with a camera that is only roughly known.
//!
//! Frames placed with a wrong camera fit badly where they overlap, and some end up in the wrong place. But what they tell of
//! the camera is much better than what was given, so they are tracked again with that, until the camera stays as it is.

use super::doubt::Doubt;
use super::gauss_newton::{Stopping, solve};
use super::options::RefineOptions;
use super::problem::{Problem, ProblemError, Sampling, Scene};
use super::track::{Tracked, track};
use crate::camera::Camera;
use crate::progress::Progress;

/// Times that the frames are tracked, at the most.
const ROUNDS: usize = 5;
/// A camera that has moved a pixel by less than this, pixels of full size, is the one the frames were placed with.
const SAME_CAMERA_PX: f64 = 2.0;
/// Points on each edge of the picture at which cameras are compared.
const STEPS_PER_EDGE: usize = 4;

/// Places all frames, with the camera's unknowns if they are to be estimated; see [`track`].
///
/// # Errors
/// [`ProblemError`].
pub fn track_calibrating(
    scene: &Scene,
    options: &RefineOptions,
    doubts: &[Option<Doubt>],
    stopping: Stopping,
    progress: &dyn Progress,
) -> Result<Tracked, ProblemError> {
    let mut scene = Scene {
        calibration: scene.calibration.of_camera(),
        ..*scene
    };
    let mut round = 1;
    loop {
        let mut tracked = track(&scene, options, doubts.to_vec(), progress)?;
        if !scene.calibration.any() {
            return Ok(tracked);
        }
        let before = scene.camera;
        scene = scene.at(tracked.kappa);
        let level = options.handover_level(scene.camera.shorter_side());
        let problem = Problem::new(&scene, Sampling::of(level), tracked.members())?;
        if problem.tiles() > 0 {
            let solution = solve(problem.calibrating(), stopping, None)?;
            tracked.estimates = solution.estimates;
            tracked.kappa = solution.kappa;
        }
        scene = scene.at(tracked.kappa);
        if moved_px(&before, &scene.camera) < SAME_CAMERA_PX || round == ROUNDS {
            return Ok(tracked);
        }
        round += 1;
    }
}

/// How far the rays of one camera's border appear from there in another, pixels, at the most.
fn moved_px(before: &Camera, after: &Camera) -> f64 {
    let border = before.border(STEPS_PER_EDGE, 0.0);
    let apart = border.iter().map(|pixel| {
        let seen = (before.ray(pixel.x, pixel.y)).and_then(|ray| after.project(&ray));
        seen.map_or(f64::INFINITY, |seen| (seen - pixel).norm())
    });
    apart.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_longer_lens_moves_the_border_outwards() {
        let before = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        let mut after = before;
        (after.fx, after.fy) = (1.02 * before.fx, 1.02 * before.fy);
        // The corners are half a diagonal from the middle.
        let expected = 0.02 * 319.5f64.hypot(239.5);
        assert!((moved_px(&before, &after) - expected).abs() < 1e-9);
        assert_eq!(moved_px(&before, &before), 0.0);
    }
}
