//! Tracking in a light and with a camera that are only roughly known.
//!
//! The mean of all frames shows the camera's light up to what is left of the wall in it, which on a
//! faint wall is as much as there is to see. So a few frames are tracked first; where they overlap
//! they tell the light ([`super::flat_field`]), and they are tracked again in that, until the light
//! stays as it is. Then the others follow.
//!
//! Likewise, frames placed with a wrong camera fit badly where they overlap, and some end up in the
//! wrong place. But what they tell of the camera is much better than what was given, so they are
//! tracked again with that, until the camera stays as it is.

use super::calibration::Kappa;
use super::doubt::Doubt;
use super::flat_field::{MAX_SHADING_FRAMES, flatten};
use super::gauss_newton::{Stopping, solve};
use super::options::RefineOptions;
use super::problem::{Problem, ProblemError, Sampling, Scene};
use super::track::{Tracked, Tracking};
use crate::camera::Camera;
use crate::progress::Progress;
use serde::{Deserialize, Serialize};

/// Times that the frames are tracked, at the most.
const ROUNDS: usize = 5;
/// A camera that has moved a pixel by less than this, pixels of full size, is the one the frames
/// were placed with.
const SAME_CAMERA_PX: f64 = 2.0;
/// Times that a few frames are tracked for the light, at the most.
const LIGHT_ROUNDS: usize = 3;
/// A light that has changed nowhere by more than this share is the one the frames were placed in.
const SAME_LIGHT: f64 = 0.01;
/// Points on each edge of the picture at which cameras are compared.
const STEPS_PER_EDGE: usize = 4;

/// Frames being placed, in one round after another.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Retracking {
    /// The round, from 0.
    round: usize,
    /// The shared unknowns that it began with.
    kappa: Kappa,
    /// Why frames are known to be useless beforehand.
    useless: Vec<Option<Doubt>>,
    tracking: Tracking,
}

impl Retracking {
    /// Nothing placed yet. `doubts` are frames known to be useless beforehand.
    pub fn begin(doubts: Vec<Option<Doubt>>) -> Self {
        let kappa = Kappa::zeros();
        Self {
            round: 0,
            kappa,
            tracking: Tracking::begin(doubts.clone(), kappa),
            useless: doubts,
        }
    }

    /// Places the first frames and corrects the shading, if there is one, by what they tell where
    /// they overlap.
    fn find_light(
        &mut self,
        scene: &Scene,
        options: &RefineOptions,
        progress: &dyn Progress,
    ) -> Result<(), ProblemError> {
        let frames = self.useless.len().min(MAX_SHADING_FRAMES);
        for _ in 0..LIGHT_ROUNDS {
            let Some(before) = scene.frames.shading() else {
                break;
            };
            self.tracking = Tracking::begin(self.useless.clone(), self.kappa);
            progress.start("light", frames);
            while self.tracking.placed() < frames {
                self.tracking.place_next(scene, options)?;
                progress.advance(1);
            }
            progress.finish();
            let mut tracked = self.tracking.so_far();
            flatten(&scene.at(tracked.kappa), options, &mut tracked)?;
            let after = scene.frames.shading();
            if after.is_none_or(|after| after.relative_difference(&before) < SAME_LIGHT) {
                break;
            }
        }
        Ok(())
    }

    /// Places all frames that are left, with the camera's unknowns if they are to be estimated.
    /// `between` is called after every frame.
    ///
    /// # Errors
    /// As [`Tracking::place_next`], and those of `between`.
    pub fn finish(
        mut self,
        scene: &Scene,
        options: &RefineOptions,
        stopping: Stopping,
        progress: &dyn Progress,
        mut between: impl FnMut(&Self) -> Result<(), ProblemError>,
    ) -> Result<Tracked, ProblemError> {
        let mut scene = Scene {
            calibration: scene.calibration.of_camera(),
            ..*scene
        }
        .at(self.kappa);
        if self.round == 0 && self.tracking.placed() == 0 {
            self.find_light(&scene, options, progress)?;
        }
        loop {
            progress.start("tracking", self.useless.len());
            progress.advance(self.tracking.placed());
            while !self.tracking.is_complete() {
                self.tracking.place_next(&scene, options)?;
                progress.advance(1);
                between(&self)?;
            }
            progress.finish();
            let mut tracked = self.tracking.clone().finish();
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
            self.round += 1;
            if moved_px(&before, &scene.camera) < SAME_CAMERA_PX || self.round == ROUNDS {
                return Ok(tracked);
            }
            self.kappa = scene.kappa;
            self.tracking = Tracking::begin(self.useless.clone(), scene.kappa);
        }
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
