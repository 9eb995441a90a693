//! Provisional tracking of frames while they are taken: the tracking of a refinement at a coarser
//! level, on locally normalised frames, so that nothing has to be known of the light beforehand.
//! The result of a refinement does not depend on it.

use crate::error::RefineError;
use crate::input::{RefineInput, is_motionless};
use crate::model::context::EstimationContext;
use crate::model::rejection::RejectionReason;
use crate::options::{Photometry, RefineOptions, ShapeMode};
use crate::parameters::calibration::Kappa;
use crate::stages::setup::Setup;
use crate::tracking::prescreening::is_featureless;
use crate::tracking::track::Tracking;
use std::sync::Arc;
use tunnelstitch_core::frames::{FrameCache, FrameError, Light, Pyramid, noise_sigma};
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::Pose;

/// Pyramid levels that frames are tracked on, from the coarsest. More are more exact than a preview
/// shows, and take longer than cameras give.
const TRACKING_LEVELS: usize = 2;
/// Frames by which the noise of the sensor is known, at the most.
const NOISE_FRAMES: usize = 32;

/// Frames that are tracked while they are taken.
pub struct LiveTracking {
    options: RefineOptions,
    /// The grey pyramids of the frames tracked so far.
    frames: Option<FrameCache>,
    tracking: Tracking,
    /// 1-σ of the noise of the first frames, grey levels.
    noises: Vec<f64>,
    skipped: usize,
}

/// Counts of frames by what has become of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LiveCounts {
    /// Frames that match the wall that others show, or are the first that show theirs.
    pub tracked: usize,
    /// Frames that show hardly any contrast or cannot be decoded.
    pub empty: usize,
    /// Frames that do not match.
    pub unmatched: usize,
    /// Frames that were not looked at, since tracking was behind.
    pub skipped: usize,
}

impl LiveTracking {
    /// Tracking that has not begun, in a cache of `cache_bytes` for frames.
    pub fn new(cache_bytes: usize) -> Self {
        Self {
            options: RefineOptions {
                calibrate: Some(Vec::new()),
                shape: ShapeMode::Fixed,
                photometry: Photometry::Normalised,
                tracking_levels: TRACKING_LEVELS,
                cache_bytes,
                ..RefineOptions::default()
            },
            frames: None,
            tracking: Tracking::open_ended(Kappa::zeros()),
            noises: Vec::new(),
            skipped: 0,
        }
    }

    /// Number of levels of the frames' pyramids, for frames whose shorter side has `side` pixels.
    pub fn levels(&self, side: u32) -> usize {
        self.options.coarsest_level(side) + 1
    }

    /// Number of frames tracked so far, those that do not match or were skipped included.
    pub fn frames(&self) -> usize {
        self.tracking.tracked_frames()
    }

    /// The poses of the frames so far; of those that are not tracked, as the prior predicts them.
    pub fn poses(&self) -> Vec<Pose> {
        let states = self.tracking.states();
        states.estimates.iter().map(|frame| frame.pose).collect()
    }

    /// Counts of the frames so far.
    pub fn counts(&self) -> LiveCounts {
        let mut counts = LiveCounts {
            skipped: self.skipped,
            ..LiveCounts::default()
        };
        for rejection in &self.tracking.states().rejections {
            match rejection {
                None => counts.tracked += 1,
                Some(RejectionReason::LeftOut) => {}
                Some(reason) if reason.shows_nothing() => counts.empty += 1,
                Some(_) => counts.unmatched += 1,
            }
        }
        counts
    }

    /// True if frame `frame` shows the wall at its pose, as far as is known: unless it shows nothing
    /// or does not match.
    pub fn shows_wall(&self, frame: usize) -> bool {
        let rejection = self.tracking.states().rejections.get(frame);
        matches!(rejection, Some(None | Some(RejectionReason::LeftOut)))
    }

    /// The locally normalised grey pyramid of a frame.
    ///
    /// # Errors
    /// A frame that cannot be decoded.
    pub fn pyramid(&self, frame: usize) -> Option<Result<Arc<Pyramid>, FrameError>> {
        self.frames.as_ref().map(|frames| frames.get(frame))
    }

    /// Tracks the frames that `input` has beyond those tracked so far, but for those that
    /// `is_skipped` names. Nothing happens as long as there are fewer than two, or they do not
    /// move.
    ///
    /// # Errors
    /// Poses that cannot be refined; equations without a solution.
    pub fn track(
        &mut self,
        input: &RefineInput,
        is_skipped: impl Fn(usize) -> bool + Sync,
    ) -> Result<(), RefineError> {
        if input.frames.len() < 2 || is_motionless(input.initial) {
            return Ok(());
        }
        let (first, options) = (self.frames(), self.options.clone());
        let mut setup = Setup::new(input.clone(), &options)?;
        match self.frames.take() {
            Some(frames) => setup.frames = setup.frames.continuing(frames),
            None => setup.frames.set_light(Light::Normalised),
        }
        let rejections: Vec<Option<RejectionReason>> =
            (first..setup.count()).par_map(|k| match is_skipped(k) {
                true => Some(RejectionReason::LeftOut),
                false => reject_empty(&setup, k),
            });
        self.measure_noise(&setup, first, &rejections);
        let noise = upper_median(self.noises.clone()).unwrap_or(0.0);
        let context = EstimationContext {
            prior: &setup.tracking_prior,
            ..setup.initial_context(noise)
        };
        for rejection in rejections {
            self.skipped += usize::from(rejection == Some(RejectionReason::LeftOut));
            self.tracking.append(rejection);
            self.tracking.track_next(&context, &options)?;
        }
        self.frames = Some(setup.frames);
        Ok(())
    }

    /// Measures the noise of further frames, as long as there are few.
    fn measure_noise(
        &mut self,
        setup: &Setup,
        first: usize,
        rejections: &[Option<RejectionReason>],
    ) {
        let left = NOISE_FRAMES.saturating_sub(self.noises.len());
        let usable = (first..)
            .zip(rejections)
            .filter(|(_, reason)| reason.is_none());
        for (k, _) in usable.take(left) {
            if let Ok(pyramid) = setup.frames.get(k) {
                self.noises.extend(noise_sigma(pyramid.level(0)));
            }
        }
    }
}

/// Rejects a frame that shows nothing or cannot be decoded.
fn reject_empty(setup: &Setup, frame: usize) -> Option<RejectionReason> {
    let is_empty = match setup.frames.get(frame) {
        Ok(pyramid) => is_featureless(pyramid.level(setup.coarsest_level())),
        Err(_) => true,
    };
    is_empty.then_some(RejectionReason::Featureless)
}
