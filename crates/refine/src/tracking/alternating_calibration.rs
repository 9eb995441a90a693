//! Tracking that alternates with the calibration of the shading and of the camera, while these are
//! only roughly known.
//!
//! The mean of all frames shows the shading up to what is left of the wall's texture in it, which
//! on a faint wall is as much as there is to see. So a few frames are tracked first. The shading is
//! corrected where they overlap ([`crate::tracking::shading_correction`]), and they are
//! tracked again with that, until the shading changes no more. Then all frames are tracked.
//!
//! Likewise, frames that are tracked with a wrong camera fit badly where they overlap, and some are
//! registered wrongly. But the camera that they are refined to is much better than the one given,
//! so they are tracked again with that, until the camera changes no more.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::options::{Photometry, RefineOptions};
use crate::parameters::calibration::Kappa;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::solver::argmin_glue::solve;
use crate::solver::stopping::Stopping;
use crate::thresholds::alternating_calibration::{MAX_CHANGE_RATIO, MAX_SHADING_CHANGE};
use crate::thresholds::tracking::MAX_TRACKING_ITERATIONS;
use crate::tracking::shading_correction::correct_until_settled;
use crate::tracking::track::Tracking;
use serde::{Deserialize, Serialize};
use tunnelstitch_core::progress::Progress;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_photometry::MAX_LIGHT_FRAMES;

/// Points on each edge of the picture at which cameras are compared.
const STEPS_PER_EDGE: usize = 4;

/// Tracking in rounds, each with the calibration that the one before has found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AlternatingCalibration {
    /// The round, counted from 0.
    round: usize,
    /// The shared parameters κ that it began with.
    kappa: Kappa,
    /// The rejection reasons of prescreening.
    rejections: Vec<Option<RejectionReason>>,
    tracking: Tracking,
}

impl AlternatingCalibration {
    /// Tracking that has not begun, with the shared parameters `kappa`; `rejections`: of frames
    /// that prescreening has rejected.
    pub fn new(rejections: Vec<Option<RejectionReason>>, kappa: Kappa) -> Self {
        Self {
            round: 0,
            kappa,
            tracking: Tracking::new(rejections.clone(), kappa),
            rejections,
        }
    }

    /// Tracks the first frames and corrects the shading, if there is one, where they overlap; false
    /// if they do not match each other, or if that does not settle: the light is no shading that
    /// all frames have in common.
    fn correct_shading(
        &mut self,
        context: &EstimationContext,
        options: &RefineOptions,
        progress: &dyn Progress,
    ) -> Result<bool, ProblemError> {
        let mut least_change = f64::INFINITY;
        let frames = self.rejections.len().min(MAX_LIGHT_FRAMES);
        for _ in 0..MAX_TRACKING_ITERATIONS {
            let Some(before) = context.frames.camera_light() else {
                return Ok(true);
            };
            self.tracking = Tracking::new(self.rejections.clone(), self.kappa);
            progress.start("light", frames);
            while self.tracking.tracked_frames() < frames {
                self.tracking.track_next(context, options)?;
                progress.advance(1);
            }
            progress.finish();
            if self.tracking.is_hopeless() {
                return Ok(false);
            }
            let mut states = self.tracking.tracked_states();
            let context = context.at(states.kappa);
            let observed = correct_until_settled(&context, options, &mut states)?;
            let after = context.frames.camera_light();
            let change = after.map_or(0.0, |after| after.relative_difference(&before, observed));
            if change < MAX_SHADING_CHANGE {
                return Ok(true);
            }
            if change > MAX_CHANGE_RATIO * least_change {
                return Ok(false);
            }
            least_change = change;
        }
        Ok(false)
    }

    /// Tracks all frames that are left, and estimates the camera's unknowns if that is asked for;
    /// None if the light is no shading that all frames have in common, and may be treated
    /// otherwise. `checkpoint` is called after every frame.
    ///
    /// # Errors
    /// As [`Tracking::track_next`], and those of `checkpoint`.
    pub fn run(
        mut self,
        context: &EstimationContext,
        options: &RefineOptions,
        stopping: Stopping,
        progress: &dyn Progress,
        mut checkpoint: impl FnMut(&Self) -> Result<(), ProblemError>,
    ) -> Result<Option<FrameStates>, ProblemError> {
        let mut context = EstimationContext {
            calibration: context.calibration.clone().intrinsics_only(),
            ..context.clone()
        }
        .at(self.kappa);
        if self.round == 0 && self.tracking.tracked_frames() == 0 {
            let is_settled = self.correct_shading(&context, options, progress)?;
            if !is_settled && options.photometry == Photometry::Auto {
                return Ok(None);
            }
        }
        loop {
            progress.start("tracking", self.rejections.len());
            progress.advance(self.tracking.tracked_frames());
            while !self.tracking.is_complete() {
                self.tracking.track_next(&context, options)?;
                progress.advance(1);
                checkpoint(&self)?;
            }
            progress.finish();
            let mut states = self.tracking.clone().into_states();
            if !context.calibration.has_free_parameters() {
                return Ok(Some(states));
            }
            let before = *context.cameras.of(0);
            context = context.at(states.kappa);
            let level = options.handover_level(context.cameras.shorter_side());
            let problem = PhotometricProblem::new(&context, Sampling::of(level), states.window())?;
            if problem.tiles() > 0 {
                let solution = solve(problem.with_shared_parameters(), stopping)?;
                states.estimates = solution.unknowns.frames;
                states.kappa = solution.unknowns.kappa;
            }
            context = context.at(states.kappa);
            self.round += 1;
            let change_px = border_displacement_px(&before, context.cameras.of(0));
            // Half a pixel of the level where tracking ends changes no registration.
            if change_px < 0.5 * 2f64.powi(level as i32) || self.round == MAX_TRACKING_ITERATIONS {
                return Ok(Some(states));
            }
            self.kappa = context.kappa;
            self.tracking = Tracking::new(self.rejections.clone(), context.kappa);
        }
    }
}

/// The largest displacement of the picture's border from one camera to another, pixels: each border
/// pixel's ray, projected by the other.
fn border_displacement_px(before: &Camera, after: &Camera) -> f64 {
    let border = before.border(STEPS_PER_EDGE, 0.0);
    let displacements = border.iter().map(|pixel| {
        let projected = (before.ray(pixel.x, pixel.y)).and_then(|ray| after.project(&ray));
        projected.map_or(f64::INFINITY, |projected| (projected - pixel).norm())
    });
    displacements.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_longer_focal_length_displaces_the_border_outwards() {
        let before = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        let mut after = before;
        (after.fx, after.fy) = (1.02 * before.fx, 1.02 * before.fy);
        // The corners are half a diagonal from the middle.
        let expected = 0.02 * 319.5f64.hypot(239.5);
        assert!((border_displacement_px(&before, &after) - expected).abs() < 1e-9);
        assert_eq!(border_displacement_px(&before, &before), 0.0);
    }
}
