//! Rejection of frames that the others do not support, once all are solved at full size.
//!
//! A frame is an inlier if it is aligned with every inlier that it shares wall with, and if such
//! pairs tie it to the others. Agreement of neighbours is not enough: a group of frames can be
//! right in itself and stand in the wrong place, if all that it shares with the others is a strip
//! without texture, or the prior. The relation of a rig's cameras ties them as a pair does, if it
//! is known as well.

use crate::model::context::EstimationContext;
use crate::model::rejection::RejectionReason;
use crate::model::significance::student_quantile;
use crate::options::RefineOptions;
use crate::problem::linearisation::FrameContribution;
use crate::thresholds::inconsistent_frames::{
    MAX_REJECTED_SHARE, MAX_TYING_SIGMA_PX, MIN_CORRELATION,
};
use crate::validation::alignment::Alignment;
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::surface::mean_radius_m;

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

/// Finds the frames that the others do not support, with the reason.
///
/// Of two misaligned frames one is wrong: the one with the largest share of its samples in
/// misaligned pairs is rejected first, until no such pair is left. The inliers are the largest
/// group of the rest that pairs, or the `ties` of a rig ([`relation_ties`]), tie together.
pub fn find_inconsistent_frames(
    alignments: &[Alignment],
    ties: &[(usize, usize)],
    frames: usize,
    options: &RefineOptions,
) -> Vec<(usize, RejectionReason)> {
    let limits = Limits::new(alignments, options);
    let mut rejected = vec![false; frames];
    let mut rejections = Vec::new();
    loop {
        let (mut all, mut misaligned) = (vec![0.0; frames], vec![0.0; frames]);
        let mut worst_px = vec![0.0f64; frames];
        for pair in alignments
            .iter()
            .filter(|p| !rejected[p.a] && !rejected[p.b])
        {
            for frame in [pair.a, pair.b] {
                all[frame] += pair.samples;
                if limits.is_misaligned(pair) {
                    misaligned[frame] += pair.samples;
                    worst_px[frame] = worst_px[frame].max(pair.error_px);
                }
            }
        }
        let share = |k: usize| misaligned[k] / all[k];
        let worst = (0..frames)
            .filter(|k| misaligned[*k] > 0.0)
            .max_by(|a, b| share(*a).total_cmp(&share(*b)));
        let Some(worst) = worst else { break };
        rejected[worst] = true;
        rejections.push((
            worst,
            RejectionReason::Misaligned {
                error_px: worst_px[worst],
            },
        ));
    }
    let aligned = alignments
        .iter()
        // Pairs with too little texture to measure are left to the covariance.
        .filter(|p| !rejected[p.a] && !rejected[p.b])
        .filter(|p| p.sigma_px <= MAX_TYING_SIGMA_PX || p.sigma_px == f64::INFINITY);
    let ties = ties.iter().filter(|(a, b)| !rejected[*a] && !rejected[*b]);
    let pairs = aligned.map(|pair| (pair.a, pair.b)).chain(ties.copied());
    let group = connected_components(pairs, frames);
    let mut sizes = vec![0usize; frames];
    // Frames without any measured pair are not judged here.
    let mut measured = vec![false; frames];
    for pair in alignments {
        (measured[pair.a], measured[pair.b]) = (true, true);
    }
    let judged: Vec<usize> = (0..frames)
        .filter(|k| measured[*k] && !rejected[*k])
        .collect();
    for k in &judged {
        sizes[group[*k]] += 1;
    }
    let largest = (0..frames).max_by_key(|k| (sizes[*k], std::cmp::Reverse(*k)));
    let disconnected = judged.iter().filter(|k| Some(group[**k]) != largest);
    rejections.extend(disconnected.map(|k| {
        let frames = sizes[group[*k]];
        (*k, RejectionReason::Disconnected { frames })
    }));
    rejections
}

/// Pairs of frames of one moment whose relation is known well enough to tie them: if its σ
/// displaces the wall in the picture by no more than [`MAX_TYING_SIGMA_PX`].
pub fn relation_ties(context: &EstimationContext) -> Vec<(usize, usize)> {
    let Some(rig) = &context.prior.rig else {
        return Vec::new();
    };
    let distance_m = mean_radius_m(context.surface.as_ref());
    let sigma_rad = (rig.rotation_sigma_rad).hypot(rig.translation_sigma_m / distance_m);
    let is_tied = |k: &usize| {
        let focal_px = context.cameras.of(*k).vertical_focal_px();
        context.prior.is_related(*k) && focal_px * sigma_rad <= MAX_TYING_SIGMA_PX
    };
    let later = (1..context.prior.initial.len()).filter(is_tied);
    later.map(|k| (k - 1, k)).collect()
}

/// Limits of the displacement of a pair.
struct Limits {
    /// Displacement that is accepted, pixels.
    max_error_px: f64,
    /// Probability that any of the pairs is found to be displaced although none is.
    false_alarm_rate: f64,
    /// Number of pairs.
    pairs: usize,
}

impl Limits {
    /// The limits for a survey with these pairs, which share its rate of false alarms.
    ///
    /// Two frames within a σ of [`RefineOptions::max_sigma_px`] are displaced by twice that at the
    /// most (2 σ). Where all pairs are displaced, camera or shape are at fault and no frame: if the
    /// two components of displacements are normal, their length exceeds its median `√(2 ln 2)` σ by
    /// the factor `√(ln(n/α)/ln 2)` once in n pairs with the probability α.
    fn new(alignments: &[Alignment], options: &RefineOptions) -> Self {
        let measured = alignments.iter().filter(|p| p.sigma_px.is_finite());
        let median = upper_median(measured.map(|p| p.error_px).collect()).unwrap_or(0.0);
        let pairs = alignments.len().max(1);
        let ratio = (pairs as f64 / options.false_alarm_rate).ln() / std::f64::consts::LN_2;
        Self {
            max_error_px: (2.0 * options.max_sigma_px).max(ratio.sqrt() * median),
            false_alarm_rate: options.false_alarm_rate,
            pairs,
        }
    }

    /// True if two frames show different things, or are displaced by more than their uncertainty
    /// explains.
    fn is_misaligned(&self, pair: &Alignment) -> bool {
        let is_different =
            pair.sigma_px <= MAX_TYING_SIGMA_PX && pair.correlation < MIN_CORRELATION;
        let sigmas = student_quantile(self.false_alarm_rate, self.pairs, pair.freedoms);
        is_different || pair.error_px > self.max_error_px + sigmas * pair.sigma_px
    }
}

/// Connected components of the graph of pairs: for each frame the first frame of its component.
fn connected_components(pairs: impl Iterator<Item = (usize, usize)>, frames: usize) -> Vec<usize> {
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

    fn find(pairs: &[Alignment], frames: usize) -> Vec<(usize, RejectionReason)> {
        find_inconsistent_frames(pairs, &[], frames, &RefineOptions::default())
    }

    fn pair(a: usize, b: usize, error_px: f64) -> Alignment {
        Alignment {
            a,
            b,
            samples: 100.0,
            error_px,
            sigma_px: 0.03,
            freedoms: 50.0,
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
    fn aligned_frames_are_all_inliers() {
        assert!(find(&chain(0..9), 9).is_empty());
    }

    #[test]
    fn only_the_misaligned_frame_is_rejected() {
        let mut pairs = chain(0..9);
        for pair in pairs.iter_mut().filter(|p| p.a == 4 || p.b == 4) {
            pair.error_px = 2.0;
        }
        let rejections = find(&pairs, 9);
        assert_eq!(
            rejections,
            vec![(4, RejectionReason::Misaligned { error_px: 2.0 })]
        );
    }

    /// Cameras that look at walls which the other one never sees.
    #[test]
    fn the_relation_of_a_rig_ties_groups_of_frames() {
        let pairs = [chain(0..6), chain(6..10)].concat();
        assert_eq!(find(&pairs, 10).len(), 4);
        let options = RefineOptions::default();
        let found = |ties| find_inconsistent_frames(&pairs, ties, 10, &options);
        assert!(found(&[(2, 7)]).is_empty());
    }

    #[test]
    fn error_within_its_uncertainty_is_accepted() {
        let mut pairs = chain(0..9);
        (pairs[3].error_px, pairs[3].sigma_px) = (1.5, 0.4);
        assert!(find(&pairs, 9).is_empty());
    }

    #[test]
    fn larger_of_two_disconnected_groups_is_inlier() {
        let mut pairs = chain(0..4);
        pairs.extend(chain(4..9));
        let rejections = find(&pairs, 9);
        let frames: Vec<usize> = rejections.iter().map(|(k, _)| *k).collect();
        assert_eq!(frames, [0, 1, 2, 3]);
        assert!(
            rejections
                .iter()
                .all(|(_, d)| *d == RejectionReason::Disconnected { frames: 4 })
        );
        // An uncertain pair ties nothing.
        let mut weak = pair(3, 4, 3.0);
        weak.sigma_px = 2.0;
        pairs.push(weak);
        assert_eq!(find(&pairs, 9).len(), 4);
        pairs.push(pair(2, 4, 0.1));
        assert!(find(&pairs, 9).is_empty());
    }

    /// A robust fit of two different things may end anywhere, also near zero displacement.
    #[test]
    fn frames_that_show_different_things_are_not_aligned() {
        let mut pairs = chain(0..4);
        pairs.extend(chain(4..11));
        let mut chance = pair(3, 4, 0.1);
        chance.correlation = 0.1;
        pairs.push(chance);
        let rejections = find(&pairs, 11);
        assert!((0..4).all(|k| rejections.iter().any(|(frame, _)| *frame == k)));
    }

    #[test]
    fn no_frame_is_rejected_where_all_pairs_are_misaligned() {
        let mut pairs = chain(0..9);
        for pair in &mut pairs {
            pair.error_px = 1.2;
        }
        assert!(find(&pairs, 9).is_empty());
    }
}
