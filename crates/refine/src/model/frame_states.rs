//! The state of every frame: its estimate, and a reason if its pixels are rejected.

use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameEstimate;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;
use tunnelstitch_geometry::camera::Sweep;
use tunnelstitch_geometry::trajectory::Pose;

/// The states of all frames, and the shared parameters.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FrameStates {
    /// Estimate of each frame.
    pub estimates: Vec<FrameEstimate>,
    /// Reason of each rejected frame; None for inliers. Rejected frames stay at their prior.
    pub rejections: Vec<Option<RejectionReason>>,
    /// Current values of the shared parameters.
    pub kappa: Kappa,
}

impl FrameStates {
    /// Frames at these poses, with exposures and shared parameters as given.
    pub fn at(poses: &[Pose], rejections: Vec<Option<RejectionReason>>) -> Self {
        Self {
            estimates: poses.iter().map(|pose| FrameEstimate::at(*pose)).collect(),
            rejections,
            kappa: Kappa::zeros(),
        }
    }

    /// Takes the exposures as given again: those of normalised frames are not those of the
    /// pictures.
    pub fn forget_exposures(&mut self) {
        for estimate in &mut self.estimates {
            *estimate = FrameEstimate::at(estimate.pose);
        }
    }

    /// The window of all frames, all estimated; rejected frames from the prior alone.
    pub fn window(&self) -> FrameWindow<'_> {
        let all = 0..self.estimates.len();
        self.window_of(all.clone(), all)
    }

    /// The window of the frames `participants`, of which those `active` are estimated and the
    /// others held fixed; rejected frames from the prior alone.
    pub fn window_of(&self, participants: Range<usize>, active: Range<usize>) -> FrameWindow<'_> {
        FrameWindow {
            estimates: &self.estimates[participants.clone()],
            compared: Cow::Owned(self.inliers(&participants)),
            participants,
            active,
        }
    }

    /// Motion of a frame's camera during its readout.
    pub fn sweep(&self, context: &EstimationContext, frame: usize) -> Sweep {
        context.sweep(frame, &(0..self.estimates.len()), &self.estimates)
    }

    /// True for the frames of `range` that are inliers.
    pub fn inliers(&self, range: &Range<usize>) -> Vec<bool> {
        self.rejections[range.clone()]
            .iter()
            .map(Option::is_none)
            .collect()
    }

    /// True if there are more inliers than frames that fit elsewhere on the wall: then others may
    /// be registered on what they show. Frames that have fitted nowhere yet do not speak against
    /// them.
    pub fn outnumber_misplaced(&self) -> bool {
        let inliers = self.rejections.iter().filter(|reason| reason.is_none());
        let reasons = self.rejections.iter().flatten();
        inliers.count() > reasons.filter(|reason| reason.is_misplaced()).count()
    }

    /// True if the inliers have a [`majority`]. If not, they may be those that are wrong.
    pub fn has_majority(&self) -> bool {
        majority(&self.rejections).is_ok()
    }

    /// Rejects frames, each with its reason.
    pub fn reject(&mut self, rejected: Vec<(usize, RejectionReason)>) {
        for (frame, reason) in rejected {
            self.rejections[frame] = Some(reason);
        }
    }
}

/// True for a frame that its pixels place among the others, as exactly as the user asks for or not.
pub fn is_placed(rejection: &Option<RejectionReason>) -> bool {
    rejection.as_ref().is_none_or(RejectionReason::is_uncertain)
}

/// Rejects all frames that their pixels place.
pub fn reject_placed(rejections: &mut [Option<RejectionReason>], reason: &RejectionReason) {
    let placed = rejections
        .iter_mut()
        .filter(|rejection| is_placed(rejection));
    placed.for_each(|rejection| *rejection = Some(reason.clone()));
}

/// Finds out whether most of the frames that show something fit each other, and are placed.
///
/// # Errors
/// The reason for which none of them is right otherwise: they may fit each other by chance, and a
/// single one agrees with no other.
pub fn majority(rejections: &[Option<RejectionReason>]) -> Result<(), RejectionReason> {
    let shows_something = |rejection: &&Option<RejectionReason>| {
        !(rejection.as_ref()).is_some_and(RejectionReason::shows_nothing)
    };
    let shown = rejections.iter().filter(shows_something).count();
    let frames = rejections.iter().filter(|r| is_placed(r)).count();
    if frames > 1 && 2 * frames > shown {
        Ok(())
    } else {
        Err(RejectionReason::Minority { frames, shown })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the frames may fit each other as far off as the other half.
    #[test]
    fn half_is_no_majority_and_frames_that_show_nothing_do_not_count() {
        let rejected = || Some(RejectionReason::Disconnected { frames: 2 });
        let dark = || Some(RejectionReason::Featureless);
        assert!(majority(&[None, None, None, rejected(), rejected()]).is_ok());
        assert!(majority(&[None, None, rejected(), dark(), dark()]).is_ok());
        let uncertain = || Some(RejectionReason::Uncertain { wall_px: 0.3 });
        assert!(majority(&[None, uncertain(), uncertain(), rejected()]).is_ok());
        let minority = RejectionReason::Minority {
            frames: 2,
            shown: 4,
        };
        let half = [None, None, rejected(), rejected(), dark()];
        assert_eq!(majority(&half), Err(minority));
        assert!(majority(&[None, dark()]).is_err());
    }
}
