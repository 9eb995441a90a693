//! The state of every frame: its estimate, and the reason if its pixels are rejected.

use crate::camera::Sweep;
use crate::refine::model::context::{Members, Scene};
use crate::refine::model::rejection::Doubt;
use crate::refine::parameters::calibration::Kappa;
use crate::refine::parameters::frame_estimate::FrameEstimate;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;

/// All frames after tracking.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Tracked {
    /// Their estimates.
    pub estimates: Vec<FrameEstimate>,
    /// Why a frame is at its prior, for those that are.
    pub doubts: Vec<Option<Doubt>>,
    /// The shared unknowns, as far as windows have found them.
    pub kappa: Kappa,
}

impl Tracked {
    /// All frames, all to be estimated; those in doubt by the prior alone.
    pub fn members(&self) -> Members<'_> {
        let all = 0..self.estimates.len();
        self.members_of(all.clone(), all)
    }

    /// The frames `participants`, of which those `active` are to be estimated and the others held;
    /// those in doubt by the prior alone.
    pub fn members_of(&self, participants: Range<usize>, active: Range<usize>) -> Members<'_> {
        Members {
            estimates: &self.estimates[participants.clone()],
            compared: Cow::Owned(self.believed(&participants)),
            participants,
            active,
        }
    }

    /// How the camera of a frame moves while its rows are read.
    pub fn sweep(&self, scene: &Scene, frame: usize) -> Sweep {
        scene.sweep(frame, &(0..self.estimates.len()), &self.estimates)
    }

    /// Which frames of a run are believed.
    pub fn believed(&self, run: &Range<usize>) -> Vec<bool> {
        self.doubts[run.clone()]
            .iter()
            .map(Option::is_none)
            .collect()
    }
}
