//! Rejection of frames of which the robust loss rejects too many pixels.

use crate::model::rejection::RejectionReason;
use crate::problem::linearisation::FrameContribution;
use crate::thresholds::disagreement::MAX_REJECTED_SHARE;

/// Rejects the frames of which the robust loss has rejected too many pixels at full size, so that
/// the last solve leaves them out.
pub fn reject_disagreeing_frames(
    shares: &[FrameContribution],
    rejections: &mut [Option<RejectionReason>],
) {
    for (share, rejection) in shares.iter().zip(rejections) {
        if rejection.is_none() && share.pixels > 0.0 {
            *rejection = find_disagreement(share);
        }
    }
}

/// The rejection reason of a frame of which the robust loss has rejected too many pixels, if it
/// has.
pub fn find_disagreement(share: &FrameContribution) -> Option<RejectionReason> {
    let share = 1.0 - share.inliers / share.pixels.max(1e-9);
    (share > MAX_REJECTED_SHARE).then_some(RejectionReason::Disagrees { share })
}
