//! Rejection of frames that the others do not support.
//!
//! A frame is an inlier if pairs that show the same wall connect it with most of the others, and if
//! it does not contradict the inliers that it shares wall with. Agreement of neighbours is not
//! enough: a group of frames can be right in itself and stand in the wrong place. Nor is a
//! contradiction: of a pair that does not show the same wall only one frame need be wrong. So of
//! two groups that agreeing pairs connect, the larger is believed against the smaller. The relation
//! of a rig's cameras connects them as a pair does, if it is known as well.

use crate::comparison::pairwise_ncc::{PairNcc, compute_pairwise_ncc};
use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::thresholds::inconsistent_frames::{MAX_CONTRADICTING_SHARE, MAX_RELATION_SIGMA_PX};
use tunnelstitch_geometry::surface::mean_radius_m;

/// The comparison of the first frames of a survey, or of all, at their present poses.
pub struct FrameComparison {
    /// Number of frames.
    pub frames: usize,
    /// Pairs of the inliers that share texture.
    pub pairs: Vec<PairNcc>,
    /// Frames that the relation of a rig's cameras connects.
    relations: Vec<(usize, usize)>,
}

impl FrameComparison {
    /// Compares the inliers among `states` with each other at a pyramid level.
    ///
    /// # Errors
    /// [`ProblemError`]: a frame that cannot be read.
    pub fn of(
        context: &EstimationContext,
        level: usize,
        states: &FrameStates,
    ) -> Result<Self, ProblemError> {
        let frames = states.estimates.len();
        Ok(Self {
            frames,
            pairs: compute_pairwise_ncc(context, level, states)?,
            relations: known_relations(context, frames),
        })
    }

    /// The frames that contradict others of a group at least as large as their own; groups are
    /// connected by pairs that show the same wall, or by relations of a rig.
    pub fn contradictions(&self) -> Vec<(usize, RejectionReason)> {
        let mut judgement = Judgement::new(self);
        judgement.reject_contradicting();
        judgement.into_rejections()
    }

    /// The frames that contradict others ([`Self::contradictions`]), and those of the rest outside
    /// their largest connected group.
    ///
    /// Frames that share no texture with any other are not judged.
    pub fn inconsistencies(&self) -> Vec<(usize, RejectionReason)> {
        let mut judgement = Judgement::new(self);
        judgement.reject_contradicting();
        judgement.reject_groups();
        judgement.into_rejections()
    }
}

/// The judgement of compared frames.
struct Judgement<'c> {
    comparison: &'c FrameComparison,
    /// True for frames that share texture with others.
    is_compared: Vec<bool>,
    /// The reasons of those rejected so far.
    reasons: Vec<Option<RejectionReason>>,
}

impl<'c> Judgement<'c> {
    fn new(comparison: &'c FrameComparison) -> Self {
        let mut is_compared = vec![false; comparison.frames];
        for pair in &comparison.pairs {
            (is_compared[pair.a], is_compared[pair.b]) = (true, true);
        }
        Self {
            comparison,
            is_compared,
            reasons: vec![None; comparison.frames],
        }
    }

    fn into_rejections(self) -> Vec<(usize, RejectionReason)> {
        let reasons = self.reasons.into_iter().enumerate();
        reasons
            .filter_map(|(k, reason)| Some((k, reason?)))
            .collect()
    }

    fn is_inlier(&self, frame: usize) -> bool {
        self.is_compared[frame] && self.reasons[frame].is_none()
    }

    /// For each frame the first frame of its connected group of inliers, and the sizes of the
    /// groups by their first frames.
    fn groups(&self) -> (Vec<usize>, Vec<usize>) {
        let FrameComparison {
            frames,
            pairs,
            relations,
        } = self.comparison;
        let same_wall = pairs.iter().filter(|pair| !pair.contradicts);
        let same_wall = same_wall.map(|pair| (pair.a, pair.b));
        let connections = same_wall.chain(relations.iter().copied());
        let connections = connections.filter(|(a, b)| self.is_inlier(*a) && self.is_inlier(*b));
        let group = connected_components(connections, *frames);
        let mut sizes = vec![0usize; *frames];
        for k in (0..*frames).filter(|k| self.is_inlier(*k)) {
            sizes[group[k]] += 1;
        }
        (group, sizes)
    }

    /// Rejects the inliers outside their largest connected group.
    fn reject_groups(&mut self) {
        let (group, sizes) = self.groups();
        let largest = (0..sizes.len()).max_by_key(|k| (sizes[*k], std::cmp::Reverse(*k)));
        for k in 0..group.len() {
            if self.is_inlier(k) && Some(group[k]) != largest {
                let frames = sizes[group[k]];
                self.reasons[k] = Some(RejectionReason::Disconnected { frames });
            }
        }
    }

    /// Rejects frames that contradict the other inliers, one by one, always the one with the
    /// largest share of its samples in contradicting pairs, until that is at most
    /// [`MAX_CONTRADICTING_SHARE`] for every frame.
    fn reject_contradicting(&mut self) {
        while let Some(worst) = self.most_contradicting() {
            self.reasons[worst] = self.worst_contradiction(worst);
        }
    }

    /// The inlier with the largest share of its samples in pairs that contradict inliers of a group
    /// at least as large as its own, if that is more than [`MAX_CONTRADICTING_SHARE`].
    fn most_contradicting(&self) -> Option<usize> {
        let frames = self.reasons.len();
        let (group, sizes) = self.groups();
        let size = |frame: usize| sizes[group[frame]];
        let (mut all, mut contradicting) = (vec![0.0; frames], vec![0.0; frames]);
        for pair in &self.comparison.pairs {
            if self.is_inlier(pair.a) && self.is_inlier(pair.b) {
                for (frame, other) in [(pair.a, pair.b), (pair.b, pair.a)] {
                    all[frame] += pair.samples;
                    if pair.contradicts && size(frame) <= size(other) {
                        contradicting[frame] += pair.samples;
                    }
                }
            }
        }
        let share = |k: &usize| contradicting[*k] / all[*k];
        let too_much = |k: &usize| contradicting[*k] > MAX_CONTRADICTING_SHARE * all[*k];
        let frames = (0..frames).filter(too_much);
        frames.max_by(|a, b| share(a).total_cmp(&share(b)))
    }

    /// The pair in which a frame contradicts another inlier most, as the reason to reject it.
    fn worst_contradiction(&self, frame: usize) -> Option<RejectionReason> {
        let pairs = self.comparison.pairs.iter();
        let contradicting = pairs.filter(|pair| pair.contradicts);
        let against = contradicting.filter_map(|pair| match pair {
            pair if pair.a == frame => Some((pair.b, pair.correlation)),
            pair if pair.b == frame => Some((pair.a, pair.correlation)),
            _ => None,
        });
        let against = against.filter(|(other, _)| self.is_inlier(*other));
        let (frame, correlation) = against.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(RejectionReason::Contradicts { frame, correlation })
    }
}

/// Pairs among the first frames, of one moment, whose relation is known well enough to connect
/// them: if its σ displaces the wall in the picture by no more than [`MAX_RELATION_SIGMA_PX`].
fn known_relations(context: &EstimationContext, frames: usize) -> Vec<(usize, usize)> {
    let Some(rig) = &context.prior.rig else {
        return Vec::new();
    };
    let distance_m = mean_radius_m(context.surface.as_ref());
    let sigma_rad = (rig.rotation_sigma_rad).hypot(rig.translation_sigma_m / distance_m);
    let is_known = |k: &usize| {
        let focal_px = context.cameras.of(*k).vertical_focal_px();
        context.prior.is_related(*k) && focal_px * sigma_rad <= MAX_RELATION_SIGMA_PX
    };
    let later = (1..frames).filter(is_known);
    later.map(|k| (k - 1, k)).collect()
}

/// Connected components of the graph of pairs: for each frame the first frame of its component.
fn connected_components(pairs: impl Iterator<Item = (usize, usize)>, frames: usize) -> Vec<usize> {
    // Each frame's way to the first one, shortened as it is walked (union–find).
    let mut earlier: Vec<usize> = (0..frames).collect();
    let first = |mut frame: usize, earlier: &mut Vec<usize>| {
        while earlier[frame] != frame {
            earlier[frame] = earlier[earlier[frame]];
            frame = earlier[frame];
        }
        frame
    };
    for (a, b) in pairs {
        let (a, b) = (first(a, &mut earlier), first(b, &mut earlier));
        earlier[a.max(b)] = a.min(b);
    }
    (0..frames).map(|k| first(k, &mut earlier)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thresholds::pairwise_ncc::MIN_CORRELATION;

    fn find(pairs: &[PairNcc], frames: usize) -> Vec<(usize, RejectionReason)> {
        find_with_relations(pairs, &[], frames)
    }

    fn find_with_relations(
        pairs: &[PairNcc],
        relations: &[(usize, usize)],
        frames: usize,
    ) -> Vec<(usize, RejectionReason)> {
        let comparison = FrameComparison {
            frames,
            pairs: pairs.to_vec(),
            relations: relations.to_vec(),
        };
        comparison.inconsistencies()
    }

    fn pair(a: usize, b: usize, correlation: f64) -> PairNcc {
        PairNcc {
            a,
            b,
            samples: 100.0,
            correlation,
            contradicts: correlation < MIN_CORRELATION,
            sharpness: None,
        }
    }

    /// A chain with links to the next and the one after it.
    fn chain(frames: std::ops::Range<usize>) -> Vec<PairNcc> {
        let links = frames.clone().flat_map(|a| [(a, a + 1), (a, a + 2)]);
        links
            .filter(|(_, b)| frames.contains(b))
            .map(|(a, b)| pair(a, b, 0.9))
            .collect()
    }

    #[test]
    fn frames_that_show_the_same_wall_are_all_inliers() {
        assert!(find(&chain(0..9), 9).is_empty());
        assert!(find(&chain(0..9)[..1], 9).is_empty());
    }

    #[test]
    fn only_the_contradicting_frame_is_rejected() {
        let mut pairs = chain(0..9);
        for pair in pairs.iter_mut().filter(|p| p.a == 5 || p.b == 5) {
            (pair.correlation, pair.contradicts) = (0.2, true);
        }
        let rejections = find(&pairs, 9);
        assert_eq!(rejections.len(), 1);
        assert_eq!(rejections[0].0, 5);
    }

    /// Two wrong frames that agree with each other, and contradict the last of the others in more
    /// of its samples than it contradicts of theirs.
    #[test]
    fn the_larger_group_is_believed_against_the_smaller() {
        let mut pairs = chain(0..9);
        pairs.push(pair(9, 10, 0.9));
        pairs.extend([pair(8, 9, 0.1), pair(8, 10, 0.0)]);
        let rejections = find(&pairs, 11);
        let contradicts = |frame, correlation| RejectionReason::Contradicts { frame, correlation };
        assert_eq!(
            rejections,
            [(9, contradicts(8, 0.1)), (10, contradicts(8, 0.0))]
        );
    }

    #[test]
    fn larger_of_two_disconnected_groups_is_inlier() {
        let mut pairs = chain(0..4);
        pairs.extend(chain(4..9));
        let rejections = find(&pairs, 9);
        let frames: Vec<usize> = rejections.iter().map(|(k, _)| *k).collect();
        assert_eq!(frames, [0, 1, 2, 3]);
        let disconnected = RejectionReason::Disconnected { frames: 4 };
        assert!(rejections.iter().all(|(_, reason)| *reason == disconnected));
        pairs.push(pair(2, 4, 0.9));
        assert!(find(&pairs, 9).is_empty());
    }

    /// Cameras that look at walls which the other one never sees.
    #[test]
    fn the_relation_of_a_rig_connects_groups_of_frames() {
        let pairs = [chain(0..6), chain(6..10)].concat();
        assert_eq!(find(&pairs, 10).len(), 4);
        assert!(find_with_relations(&pairs, &[(2, 7)], 10).is_empty());
    }
}
