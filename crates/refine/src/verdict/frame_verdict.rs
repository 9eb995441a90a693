//! The verdict about a frame: all evidence, one decision, one reason.
//!
//! A frame is photometric if its pixels determine its pose: the pose is within its stated σ, and σ
//! against the frames that show the same wall is no more than the user allows. Stages before may
//! have rejected it: it shows nothing, or other things than the frames around it, or it fits at
//! two places. What is left is decided here, from the last solve.

use crate::model::rejection::RejectionReason;
use crate::options::RefineOptions;
use crate::problem::linearisation::FrameContribution;
use crate::thresholds::assessment::MIN_PIXEL_SHARE;
use crate::uncertainty::frame_sigma::FrameSigma;
use crate::validation::disagreement::find_disagreement;

/// The evidence about a frame at the end of the last solve.
#[derive(Clone, Debug)]
pub struct FrameEvidence<'e> {
    /// The rejection reason that an earlier test has found.
    pub rejection: Option<RejectionReason>,
    /// The frame's contribution to the solve.
    pub contribution: &'e FrameContribution,
    /// Number of its pixels that could be compared, if all of them showed common wall.
    pub all_pixels: f64,
    /// 1-σ of its pose, model errors included.
    pub sigma: FrameSigma,
}

impl FrameEvidence<'_> {
    /// The reason for which the frame is not photometric; None if it is.
    pub fn judge(self, options: &RefineOptions) -> Option<RejectionReason> {
        let Self {
            rejection,
            contribution,
            all_pixels,
            sigma,
        } = self;
        let has_overlap = contribution.pixels >= MIN_PIXEL_SHARE * all_pixels;
        let no_overlap = (!has_overlap).then(|| RejectionReason::NoOverlap {
            share: contribution.pixels / all_pixels,
        });
        let registration_px = sigma.registration_px;
        let is_uncertain = registration_px.is_nan() || registration_px > options.max_sigma_px;
        let uncertain = is_uncertain.then_some(RejectionReason::Uncertain {
            wall_px: sigma.registration_px,
        });
        rejection
            .or(no_overlap)
            .or_else(|| find_disagreement(contribution))
            .or(uncertain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(registration_px: f64, inliers: f64) -> Option<RejectionReason> {
        let contribution = FrameContribution {
            samples: 100,
            pixels: 100.0,
            inliers,
            square: 1.0,
        };
        let sigma = FrameSigma {
            rotation_deg: 0.01,
            translation_m: 0.001,
            wall_m: 0.001,
            wall_px: 0.1,
            registration_px,
        };
        let evidence = FrameEvidence {
            rejection: None,
            contribution: &contribution,
            all_pixels: 200.0,
            sigma,
        };
        evidence.judge(&RefineOptions::default())
    }

    #[test]
    fn the_first_reason_counts() {
        use RejectionReason::{Disagrees, Uncertain};
        assert_eq!(judge(0.02, 95.0), None);
        assert!(matches!(judge(0.3, 95.0), Some(Uncertain { .. })));
        assert!(matches!(judge(f64::NAN, 95.0), Some(Uncertain { .. })));
        assert!(matches!(judge(0.3, 20.0), Some(Disagrees { .. })));
    }
}
