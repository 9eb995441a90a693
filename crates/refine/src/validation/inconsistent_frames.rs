//! Rejection of frames that the others do not support, once all are solved at full size.
//!
//! A frame is an inlier if it is as sharp as the others, if it is aligned with every inlier that it
//! shares wall with and shows the same, and if such pairs tie it to the others. Agreement of
//! neighbours is not enough: a group of frames can be right in itself and stand in the wrong place,
//! if all that it shares with the others is a strip without texture, or the prior.

use crate::model::rejection::RejectionReason;
use crate::model::significance::normal_quantile;
use crate::options::RefineOptions;
use crate::problem::linearisation::FrameContribution;
use crate::thresholds::inconsistent_frames::{
    MAX_REJECTED_SHARE, MAX_TYING_SIGMA_PX, MIN_CORRELATION, MIN_SHARPNESS_RATIO,
};
use crate::validation::alignment::{Alignment, Displacement};
use tunnelstitch_geometry::numerics::median::upper_median;

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
/// Blurred frames are rejected first. Of two frames that are misaligned or show different things
/// one is wrong: the one with the largest share of its samples in such pairs is rejected first,
/// until none is left. The inliers are the largest group of the rest that pairs tie together.
pub fn find_inconsistent_frames(
    alignments: &[Alignment],
    frames: usize,
    options: &RefineOptions,
) -> Vec<(usize, RejectionReason)> {
    let limits = Limits::new(alignments, options);
    let mut rejections = find_blurred_frames(alignments, frames);
    let mut rejected = vec![false; frames];
    for (frame, _) in &rejections {
        rejected[*frame] = true;
    }
    loop {
        let (mut all, mut refuted) = (vec![0.0; frames], vec![0.0; frames]);
        let present = || {
            let both_left = |pair: &&Alignment| !rejected[pair.a] && !rejected[pair.b];
            alignments.iter().filter(both_left)
        };
        for pair in present() {
            for frame in [pair.a, pair.b] {
                all[frame] += pair.samples;
                if limits.is_misaligned(pair) || limits.is_different(pair) {
                    refuted[frame] += pair.samples;
                }
            }
        }
        let share = |k: usize| refuted[k] / all[k];
        let worst = (0..frames)
            .filter(|k| refuted[*k] > 0.0)
            .max_by(|a, b| share(*a).total_cmp(&share(*b)));
        let Some(worst) = worst else { break };
        let own = present().filter(|pair| pair.a == worst || pair.b == worst);
        rejections.push((worst, limits.reason_against(worst, own)));
        rejected[worst] = true;
    }
    let aligned = alignments
        .iter()
        // Pairs with too little texture to measure are left to the covariance.
        .filter(|p| !rejected[p.a] && !rejected[p.b])
        .filter(|p| {
            let sigma_px = p.displacement.sigma_px;
            sigma_px <= MAX_TYING_SIGMA_PX || sigma_px == f64::INFINITY
        });
    let group = connected_components(aligned.map(|pair| (pair.a, pair.b)), frames);
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

/// Limits of the displacement of a pair.
struct Limits {
    /// Displacement that is accepted, pixels.
    max_error_px: f64,
    /// z: σ beyond it from which on a pair is misaligned.
    sigmas: f64,
}

impl Limits {
    /// The limits for a survey with these pairs, which share its rate of false alarms.
    ///
    /// Two frames within a σ of [`RefineOptions::max_sigma_px`] are displaced by twice that at the
    /// most (2 σ). Where all pairs are displaced, camera or shape are at fault and no frame: if the
    /// two components of displacements are normal, their length exceeds its median `√(2 ln 2)` σ by
    /// the factor `√(ln(n/α)/ln 2)` once in n pairs with the probability α.
    fn new(alignments: &[Alignment], options: &RefineOptions) -> Self {
        let displacements = alignments.iter().map(|pair| pair.displacement);
        let measured = displacements.filter(|d| d.sigma_px.is_finite());
        let median = upper_median(measured.map(|d| d.error_px).collect()).unwrap_or(0.0);
        let pairs = alignments.len().max(1);
        let ratio = (pairs as f64 / options.false_alarm_rate).ln() / std::f64::consts::LN_2;
        Self {
            max_error_px: (2.0 * options.max_sigma_px).max(ratio.sqrt() * median),
            sigmas: normal_quantile(options.false_alarm_rate, pairs),
        }
    }

    /// True if two frames are displaced by more than their uncertainty explains.
    fn is_misaligned(&self, pair: &Alignment) -> bool {
        let Displacement { error_px, sigma_px } = pair.displacement;
        error_px > self.max_error_px + self.sigmas * sigma_px
    }

    /// True if two frames correlate so little that they show different things.
    fn is_different(&self, pair: &Alignment) -> bool {
        pair.contrast.is_below(MIN_CORRELATION, self.sigmas)
    }

    /// The reason to reject a frame with these pairs: its largest displacement, or without any, the
    /// frame that it correlates with the least.
    fn reason_against<'p>(
        &self,
        frame: usize,
        pairs: impl Iterator<Item = &'p Alignment> + Clone,
    ) -> RejectionReason {
        let misaligned = pairs.clone().filter(|pair| self.is_misaligned(pair));
        let worst_px = misaligned.map(|pair| pair.displacement.error_px);
        if let Some(error_px) = worst_px.max_by(f64::total_cmp) {
            return RejectionReason::Misaligned { error_px };
        }
        let different = pairs.filter(|pair| self.is_different(pair));
        let correlations = different.map(|pair| {
            let other = if pair.a == frame { pair.b } else { pair.a };
            (other, pair.contrast.corrected())
        });
        let least = correlations.min_by(|a, b| a.1.total_cmp(&b.1));
        let (frame, correlation) = least.unwrap_or((frame, 1.0));
        RejectionReason::Contradicts { frame, correlation }
    }
}

/// Finds the frames that show less fine detail than the frames that they overlap.
fn find_blurred_frames(alignments: &[Alignment], frames: usize) -> Vec<(usize, RejectionReason)> {
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); frames];
    for (pair, ratio) in alignments
        .iter()
        .filter_map(|pair| Some((pair, pair.sharpness_ratio?)))
    {
        ratios[pair.a].push(ratio);
        ratios[pair.b].push(1.0 / ratio);
    }
    let shares = ratios.into_iter().map(upper_median).enumerate();
    shares
        .filter_map(|(frame, share)| Some((frame, share?)))
        .filter(|(_, share)| *share < MIN_SHARPNESS_RATIO)
        .map(|(frame, share)| (frame, RejectionReason::Blurred { share }))
        .collect()
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
    use crate::validation::patch_correlation::PatchCorrelation;

    fn find(pairs: &[Alignment], frames: usize) -> Vec<(usize, RejectionReason)> {
        find_inconsistent_frames(pairs, frames, &RefineOptions::default())
    }

    fn pair(a: usize, b: usize, error_px: f64) -> Alignment {
        Alignment {
            a,
            b,
            samples: 1000.0,
            displacement: Displacement {
                error_px,
                sigma_px: 0.03,
            },
            contrast: contrast(0.9),
            sharpness_ratio: Some(1.0),
        }
    }

    fn contrast(correlation: f64) -> PatchCorrelation {
        PatchCorrelation {
            correlation,
            texture_share: 1.0,
            independent: 200.0,
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
            pair.displacement.error_px = 2.0;
        }
        let rejections = find(&pairs, 9);
        assert_eq!(
            rejections,
            vec![(4, RejectionReason::Misaligned { error_px: 2.0 })]
        );
    }

    #[test]
    fn error_within_its_uncertainty_is_accepted() {
        let mut pairs = chain(0..9);
        pairs[3].displacement = Displacement {
            error_px: 1.5,
            sigma_px: 0.4,
        };
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
        weak.displacement.sigma_px = 2.0;
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
        chance.contrast = contrast(0.1);
        pairs.push(chance);
        let rejections = find(&pairs, 11);
        assert!((0..4).all(|k| rejections.iter().any(|(frame, _)| *frame == k)));
    }

    #[test]
    fn only_the_frame_that_shows_something_else_is_rejected() {
        let mut pairs = chain(0..9);
        for (k, pair) in pairs.iter_mut().enumerate() {
            if pair.a == 5 || pair.b == 5 {
                pair.contrast = contrast(0.4 - 0.01 * k as f64);
            }
        }
        let rejections = find(&pairs, 9);
        let [(5, RejectionReason::Contradicts { frame: 7, .. })] = rejections[..] else {
            panic!("{rejections:?}");
        };
    }

    #[test]
    fn frame_without_fine_detail_is_blurred() {
        let mut pairs = [pair(0, 1, 0.05), pair(1, 2, 0.05), pair(0, 2, 0.05)];
        (pairs[0].sharpness_ratio, pairs[1].sharpness_ratio) = (Some(5.0), Some(0.2));
        let rejections = find(&pairs, 3);
        assert_eq!(
            rejections,
            vec![(1, RejectionReason::Blurred { share: 0.2 })]
        );
    }

    #[test]
    fn no_frame_is_rejected_where_all_pairs_are_misaligned() {
        let mut pairs = chain(0..9);
        for pair in &mut pairs {
            pair.displacement.error_px = 1.2;
        }
        assert!(find(&pairs, 9).is_empty());
    }
}
