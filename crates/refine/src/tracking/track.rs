//! Tracking: registers one frame after another and solves sliding windows.
//!
//! Registering each frame only against those before it accumulates error exponentially. Windows of
//! the last frames that may overlap, solved together every few frames with the oldest third held,
//! keep it bounded ([`crate::tracking::windows`]).
//!
//! A frame that cannot be registered stays at the prior's prediction, and no other is compared with
//! it.

use crate::comparison::inconsistent_frames::FrameComparison;
use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::options::RefineOptions;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::samples::footprints::footprint;
use crate::samples::footprints::footprints;
use crate::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use crate::thresholds::tracking::MAX_FAILURES;
use crate::tracking::neighbours::Neighbours;
use crate::tracking::pose_prediction::{PosePrediction, predict_pose};
use crate::tracking::registration::{Effort, Registered, register_frame};
use crate::tracking::windows::{LONG_WINDOW_STRIDE, solve_long_window, solve_sliding_window};
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::surface::Footprint;

/// Sliding windows in which a frame is solved for, at most: the longer windows are, the fewer of
/// them, so that the time of tracking is proportional to the number of frames.
const WINDOW_SOLVES_PER_FRAME: usize = 6;

/// Frames that are tracked one after another.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Tracking {
    /// The estimates of those tracked so far; the rejection reasons of all frames.
    states: FrameStates,
    /// The parts of the wall that they saw when they were tracked.
    footprints: Vec<Footprint>,
    /// The first frame that the last tracked one of each camera may share wall with.
    earliest_overlaps: Vec<usize>,
    /// The last shared parameters κ that made a valid camera.
    kappa: Kappa,
    /// Frames that were registered on others, or were tried to.
    attempts: usize,
    /// Those of them that matched as well as right poses do.
    matches: usize,
    /// True if most of the first frames do not show the same wall.
    is_hopeless: bool,
    /// The effort that is left for registrations.
    effort: Effort,
    /// Frames tracked since the last sliding window.
    frames_since_window: usize,
    /// True if the pose of the last tracked frame was reliable.
    was_reliable: bool,
    /// True while frames are taken, so that others may follow those that are known.
    is_open_ended: bool,
}

impl Tracking {
    /// Tracking that has not begun; `rejections`: of frames that prescreening has rejected.
    pub fn new(rejections: Vec<Option<RejectionReason>>, kappa: Kappa) -> Self {
        Self {
            states: FrameStates {
                estimates: Vec::with_capacity(rejections.len()),
                rejections,
                kappa,
            },
            footprints: Vec::new(),
            earliest_overlaps: Vec::new(),
            kappa,
            attempts: 0,
            matches: 0,
            is_hopeless: false,
            effort: Effort::default(),
            frames_since_window: 0,
            was_reliable: true,
            is_open_ended: false,
        }
    }

    /// Tracking of frames that are still to be taken, none of which is known.
    pub fn open_ended(kappa: Kappa) -> Self {
        Self {
            is_open_ended: true,
            ..Self::new(Vec::new(), kappa)
        }
    }

    /// Appends a frame, with the reason if it is rejected before it is tracked.
    pub fn append(&mut self, rejection: Option<RejectionReason>) {
        self.states.rejections.push(rejection);
    }

    /// The number of frames tracked so far, rejected ones included.
    pub fn tracked_frames(&self) -> usize {
        self.states.estimates.len()
    }

    /// True if so many frames did not match, and do not show the same wall where they fitted, that
    /// no others will.
    pub fn is_hopeless(&self) -> bool {
        self.is_hopeless
    }

    /// True if all frames are tracked.
    pub fn is_complete(&self) -> bool {
        !self.is_open_ended && self.tracked_frames() == self.states.rejections.len()
    }

    /// The states of the frames tracked so far, without the others.
    pub fn tracked_states(&self) -> FrameStates {
        let mut states = self.states.clone();
        states.rejections.truncate(states.estimates.len());
        states
    }

    /// The estimates of the frames tracked so far; the rejection reasons of all that are known.
    pub fn states(&self) -> &FrameStates {
        &self.states
    }

    /// The states of all frames.
    pub fn into_states(self) -> FrameStates {
        self.states
    }

    /// Tracks the next frame, and solves the windows that end with it.
    ///
    /// # Errors
    /// [`ProblemError`] if the frame cannot be read, its initial pose lies outside the tunnel, or
    /// equations have no solution.
    pub fn track_next(
        &mut self,
        context: &EstimationContext,
        options: &RefineOptions,
    ) -> Result<(), ProblemError> {
        let (k, attempts) = (self.tracked_frames(), self.attempts);
        let context = &context.at(self.kappa).at(self.states.kappa);
        self.kappa = context.kappa;
        let predicted = predict_pose(context, k, &self.states);
        if self.is_hopeless {
            let reason = RejectionReason::NotTried {
                failures: self.attempts,
            };
            self.states.rejections[k].get_or_insert(reason);
        }
        let estimate = FrameEstimate::at(predicted.pose);
        self.states.estimates.push(estimate);
        self.footprints.push(footprint(
            context,
            context.cameras.of(k),
            k,
            &predicted.pose,
        )?);
        let first = find_earliest_overlap(context, &self.footprints);
        let is_reliable = self.register(context, options, &predicted, first)?;
        self.solve_windows(context, options, first, is_reliable)?;
        let pose = &self.states.estimates[k].pose;
        self.footprints[k] = footprint(context, context.cameras.of(k), k, pose)?;
        if attempts < MAX_FAILURES && self.attempts == MAX_FAILURES && self.matches == 0 {
            self.is_hopeless = !self.shows_one_wall(context, options)?;
        }
        Ok(())
    }

    /// True if most of the frames tracked so far show the same wall, pair by pair. In light that is
    /// not as modelled they do, though none matches as right ones should.
    fn shows_one_wall(
        &self,
        context: &EstimationContext,
        options: &RefineOptions,
    ) -> Result<bool, ProblemError> {
        let mut states = self.tracked_states();
        let level = options.handover_level(context.cameras.shorter_side());
        states.reject(FrameComparison::of(context, level, &states)?.contradictions());
        Ok(states.has_majority())
    }

    /// Solves the windows that end with the last frame, if they are due; `first`: the first frame
    /// that it may share wall with, `is_reliable`: of its pose.
    fn solve_windows(
        &mut self,
        context: &EstimationContext,
        options: &RefineOptions,
        first: usize,
        is_reliable: bool,
    ) -> Result<(), ProblemError> {
        let k = self.tracked_frames() - 1;
        // The frame overlaps earlier frames than the one before it did: a turn has closed on wall
        // that was tracked without it, and the drift in between may be many pixels.
        self.earliest_overlaps.resize(context.cameras.count(), 0);
        let camera = k % context.cameras.count();
        let before = std::mem::replace(&mut self.earliest_overlaps[camera], first);
        let closes_turn = first < before;
        self.frames_since_window += 1;
        let stride = options
            .window_stride
            .max((k - first) / WINDOW_SOLVES_PER_FRAME);
        let is_due = self.frames_since_window >= stride || self.is_complete();
        // A window that did not help when reliability was lost does not help one frame later.
        let has_become_unreliable = self.was_reliable && !is_reliable;
        self.was_reliable = is_reliable;
        if k > 0 {
            if closes_turn || has_become_unreliable || is_due {
                let drifted = closes_turn || !is_reliable;
                solve_sliding_window(context, options, first, drifted, &mut self.states)?;
                self.frames_since_window = 0;
            }
            if k.is_multiple_of(LONG_WINDOW_STRIDE) {
                solve_long_window(context, options, &mut self.states)?;
            }
        }
        Ok(())
    }

    /// Registers the last frame on the wall that frames from `first` on show; false if its pose is
    /// not reliable.
    fn register(
        &mut self,
        context: &EstimationContext,
        options: &RefineOptions,
        predicted: &PosePrediction,
        first: usize,
    ) -> Result<bool, ProblemError> {
        let states = &mut self.states;
        let k = states.estimates.len() - 1;
        if states.rejections[k].is_some() || first >= k {
            return Ok(true);
        }
        let frame_range = first..k + 1;
        let mut registered = states.inliers(&frame_range);
        registered[k - first] = false;
        if !registered.contains(&true) {
            return Ok(true);
        }
        let neighbours = Neighbours {
            estimates: &states.estimates[frame_range.clone()],
            registered: &registered,
            footprints: &self.footprints[frame_range.clone()],
            frame_range,
        };
        self.attempts += 1;
        self.effort.grant();
        match register_frame(
            context,
            options,
            k,
            predicted,
            &neighbours,
            &mut self.effort,
        )? {
            Ok(Registered {
                estimate,
                is_reliable,
                ..
            }) => {
                self.matches += usize::from(is_reliable);
                states.estimates[k] = estimate;
                Ok(is_reliable)
            }
            Err(reason) => {
                states.rejections[k] = Some(reason);
                Ok(true)
            }
        }
    }
}

/// The first frame that may share wall with the last one; the last one itself if there is none.
fn find_earliest_overlap(context: &EstimationContext, footprints: &[Footprint]) -> usize {
    let last = footprints.len() - 1;
    let perimeter = context.surface.perimeter_m();
    (last.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)..last)
        .find(|k| footprints[*k].overlaps(&footprints[last], perimeter))
        .unwrap_or(last)
}

/// Registers rejected frames again, now that there are frames on both sides of them; returns how
/// many have been registered. Frames that show nothing are left out.
///
/// # Errors
/// [`ProblemError`].
pub fn register_rejected(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &mut FrameStates,
) -> Result<usize, ProblemError> {
    let count = states.estimates.len();
    let mut registered_frames = 0;
    let mut effort = Effort::default();
    let mut footprints = footprints(context, states)?;
    for k in 0..count {
        if !states.rejections[k]
            .as_ref()
            .is_some_and(RejectionReason::is_retriable)
        {
            continue;
        }
        let frame_range = k.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)
            ..(k + MAX_OVERLAP_DISTANCE_FRAMES).min(count);
        let predicted = predict_pose(context, k, states);
        let registered = states.inliers(&frame_range);
        let neighbours = Neighbours {
            estimates: &states.estimates[frame_range.clone()],
            registered: &registered,
            footprints: &footprints[frame_range.clone()],
            frame_range,
        };
        effort.grant();
        let result = register_frame(context, options, k, &predicted, &neighbours, &mut effort)?;
        states.estimates[k] = match result {
            Ok(registered) => {
                states.rejections[k] = None;
                registered_frames += 1;
                registered.estimate
            }
            Err(_) => FrameEstimate::at(predicted.pose),
        };
        footprints[k] = footprint(context, context.cameras.of(k), k, &states.estimates[k].pose)?;
    }
    Ok(registered_frames)
}
