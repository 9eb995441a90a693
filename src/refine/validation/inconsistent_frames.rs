//! Which frames the others bear out, once all are solved at full size.
//!
//! A frame is inliers if it is aligned with every inliers frame that it shares wall with, and if
//! such pairs tie it to the rest. Agreement of neighbours is not enough: a group of frames can be
//! right in itself and stand in the wrong place, when all it shares with the others is a strip that
//! says nothing, or the prior.

use crate::refine::model::rejection::RejectionReason;
use crate::refine::problem::linearisation::FrameContribution;
use crate::refine::validation::pairwise_lucas_kanade::Alignment;

/// Pairs may be misaligned by this much, pixels, ...
const TOLERANCE_PX: f64 = 0.5;
/// ... or by this many times what is usual in the survey: where all pairs are, the calibration is
/// at fault, no frame.
const TIMES_USUAL: f64 = 4.0;
/// z: a pair that is aligned to the tolerance is called misaligned about once in a million.
const SURE: f64 = 5.0;
/// Correlation below which two frames, sharp enough to be measured, do not show the same.
const LEAST_CORRELATION: f64 = 0.3;
/// σ of a displacement, pixels, up to which a pair ties its frames to each other.
const TIED_PX: f64 = 1.0;

/// Share of a frame's weight that the robust loss may reject. Things before the wall, glints and
/// oblique views cost a right frame some; whether its pose is right is decided by its alignment with
/// others. Higher: fewer frames are rejected.
const MAX_REJECTED_SHARE: f64 = 0.3;

/// Rejects the frames of which the robust loss has rejected most pixels at full size, so that the
/// last solve does without them.
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

/// The rejection reason of a frame of which the robust loss has rejected most pixels.
pub fn find_disagreement(share: &FrameContribution) -> Option<RejectionReason> {
    let share = 1.0 - share.inliers / share.pixels.max(1e-9);
    (share > MAX_REJECTED_SHARE).then_some(RejectionReason::Disagrees { share })
}

/// The frames that the others do not bear out, with the reason.
///
/// Where two frames are misaligned, one is to blame: the one with the larger share of its overlap
/// in such pairs is taken out first, until no pair is left. Of what remains, the largest group that
/// pairs tie together is inliers.
pub fn find_inconsistent_frames(
    alignments: &[Alignment],
    frames: usize,
) -> Vec<(usize, RejectionReason)> {
    let most_px = most_px(alignments);
    let mut out = vec![false; frames];
    let mut rejections = Vec::new();
    loop {
        let (mut all, mut bad) = (vec![0.0; frames], vec![0.0; frames]);
        let mut worst_px = vec![0.0f64; frames];
        for pair in alignments.iter().filter(|p| !out[p.a] && !out[p.b]) {
            for frame in [pair.a, pair.b] {
                all[frame] += pair.samples;
                if misaligned(pair, most_px) {
                    bad[frame] += pair.samples;
                    worst_px[frame] = worst_px[frame].max(pair.error_px);
                }
            }
        }
        let share = |k: usize| bad[k] / all[k];
        let worst = (0..frames)
            .filter(|k| bad[*k] > 0.0)
            .max_by(|a, b| share(*a).total_cmp(&share(*b)));
        let Some(worst) = worst else { break };
        out[worst] = true;
        rejections.push((
            worst,
            RejectionReason::Misaligned {
                error_px: worst_px[worst],
            },
        ));
    }
    let good = alignments
        .iter()
        // What is too faint to measure is left to the covariance.
        .filter(|p| !out[p.a] && !out[p.b])
        .filter(|p| p.sigma_px <= TIED_PX || p.sigma_px == f64::INFINITY);
    let group = groups(good.map(|pair| (pair.a, pair.b)), frames);
    let mut sizes = vec![0usize; frames];
    // Frames that no pair was measured for are not judged here.
    let mut measured = vec![false; frames];
    for pair in alignments {
        (measured[pair.a], measured[pair.b]) = (true, true);
    }
    let judged: Vec<usize> = (0..frames).filter(|k| measured[*k] && !out[*k]).collect();
    for k in &judged {
        sizes[group[*k]] += 1;
    }
    let largest = (0..frames).max_by_key(|k| (sizes[*k], std::cmp::Reverse(*k)));
    let apart = judged.iter().filter(|k| Some(group[**k]) != largest);
    rejections.extend(apart.map(|k| {
        let frames = sizes[group[*k]];
        (*k, RejectionReason::Disconnected { frames })
    }));
    rejections
}

fn misaligned(pair: &Alignment, most_px: f64) -> bool {
    let different = pair.sigma_px <= TIED_PX && pair.correlation < LEAST_CORRELATION;
    different || pair.error_px > most_px + SURE * pair.sigma_px
}

/// The alignment error that is borne, pixels.
fn most_px(alignments: &[Alignment]) -> f64 {
    let measured = alignments.iter().filter(|p| p.sigma_px.is_finite());
    let mut errors: Vec<f64> = measured.map(|p| p.error_px).collect();
    errors.sort_unstable_by(f64::total_cmp);
    let usual = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
    TOLERANCE_PX.max(TIMES_USUAL * usual)
}

/// For each frame the first frame of the group that pairs tie it to.
fn groups(pairs: impl Iterator<Item = (usize, usize)>, frames: usize) -> Vec<usize> {
    let mut group: Vec<usize> = (0..frames).collect();
    for (a, b) in pairs {
        let (a, b) = (group[a], group[b]);
        if a != b {
            let (first, other) = (a.min(b), a.max(b));
            group
                .iter_mut()
                .filter(|g| **g == other)
                .for_each(|g| *g = first);
        }
    }
    group
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(a: usize, b: usize, error_px: f64) -> Alignment {
        Alignment {
            a,
            b,
            samples: 100.0,
            error_px,
            sigma_px: 0.03,
            correlation: 0.9,
        }
    }

    /// A chain with links to the next and the one after it.
    fn chain(frames: std::ops::Range<usize>) -> Vec<Alignment> {
        let links = frames.clone().flat_map(|a| [(a, a + 1), (a, a + 2)]);
        links
            .filter(|(_, b)| frames.contains(b))
            .map(|(a, b)| pair(a, b, 0.05))
            .collect()
    }

    #[test]
    fn aligned_frames_are_all_believed() {
        assert!(find_inconsistent_frames(&chain(0..9), 9).is_empty());
    }

    #[test]
    fn the_misaligned_frame_is_to_blame_and_not_its_neighbours() {
        let mut pairs = chain(0..9);
        for pair in pairs.iter_mut().filter(|p| p.a == 4 || p.b == 4) {
            pair.error_px = 2.0;
        }
        let rejections = find_inconsistent_frames(&pairs, 9);
        assert_eq!(
            rejections,
            vec![(4, RejectionReason::Misaligned { error_px: 2.0 })]
        );
    }

    #[test]
    fn an_error_within_its_uncertainty_is_no_error() {
        let mut pairs = chain(0..9);
        (pairs[3].error_px, pairs[3].sigma_px) = (1.5, 0.4);
        assert!(find_inconsistent_frames(&pairs, 9).is_empty());
    }

    #[test]
    fn of_two_groups_that_nothing_ties_the_larger_is_believed() {
        let mut pairs = chain(0..4);
        pairs.extend(chain(4..9));
        let rejections = find_inconsistent_frames(&pairs, 9);
        let frames: Vec<usize> = rejections.iter().map(|(k, _)| *k).collect();
        assert_eq!(frames, [0, 1, 2, 3]);
        assert!(
            rejections
                .iter()
                .all(|(_, d)| *d == RejectionReason::Disconnected { frames: 4 })
        );
        // A strip that tells nothing ties nothing.
        let mut weak = pair(3, 4, 3.0);
        weak.sigma_px = 2.0;
        pairs.push(weak);
        assert_eq!(find_inconsistent_frames(&pairs, 9).len(), 4);
        pairs.push(pair(2, 4, 0.1));
        assert!(find_inconsistent_frames(&pairs, 9).is_empty());
    }

    /// A robust fit of two different things may end anywhere, near none too.
    #[test]
    fn frames_that_show_different_things_are_not_aligned() {
        let mut pairs = chain(0..4);
        pairs.extend(chain(4..11));
        let mut chance = pair(3, 4, 0.1);
        chance.correlation = 0.1;
        pairs.push(chance);
        let doubted = find_inconsistent_frames(&pairs, 11);
        assert!((0..4).all(|k| doubted.iter().any(|(frame, _)| *frame == k)));
    }

    #[test]
    fn where_all_pairs_are_off_no_frame_is_to_blame() {
        let mut pairs = chain(0..9);
        for pair in &mut pairs {
            pair.error_px = 1.2;
        }
        assert!(find_inconsistent_frames(&pairs, 9).is_empty());
    }
}
