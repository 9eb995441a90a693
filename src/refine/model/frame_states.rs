//! The state of every frame: its estimate, and the reason if its pixels are rejected.

use crate::camera::Sweep;
use crate::refine::model::context::{EstimationContext, FrameWindow};
use crate::refine::model::rejection::RejectionReason;
use crate::refine::parameters::calibration::Kappa;
use crate::refine::parameters::frame_estimate::FrameEstimate;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;

/// All frames after tracking.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FrameStates {
    /// Their estimates.
    pub estimates: Vec<FrameEstimate>,
    /// Why a frame is at its prior, for those that are.
    pub rejections: Vec<Option<RejectionReason>>,
    /// The shared unknowns, as far as windows have found them.
    pub kappa: Kappa,
}

impl FrameStates {
    /// All frames, all to be estimated; those in rejection by the prior alone.
    pub fn window(&self) -> FrameWindow<'_> {
        let all = 0..self.estimates.len();
        self.window_of(all.clone(), all)
    }

    /// The frames `participants`, of which those `active` are to be estimated and the others held;
    /// those in rejection by the prior alone.
    pub fn window_of(&self, participants: Range<usize>, active: Range<usize>) -> FrameWindow<'_> {
        FrameWindow {
            estimates: &self.estimates[participants.clone()],
            compared: Cow::Owned(self.inliers(&participants)),
            participants,
            active,
        }
    }

    /// How the camera of a frame moves while its rows are read.
    pub fn sweep(&self, scene: &EstimationContext, frame: usize) -> Sweep {
        scene.sweep(frame, &(0..self.estimates.len()), &self.estimates)
    }

    /// Which frames of a run are inliers.
    pub fn inliers(&self, run: &Range<usize>) -> Vec<bool> {
        self.rejections[run.clone()]
            .iter()
            .map(Option::is_none)
            .collect()
    }

    /// Rejects frames, each with its reason.
    pub fn reject(&mut self, found: Vec<(usize, RejectionReason)>) {
        for (frame, reason) in found {
            self.rejections[frame] = Some(reason);
        }
    }
}
