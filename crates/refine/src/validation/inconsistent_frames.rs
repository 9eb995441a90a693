//! Rejection of frames that the others do not support.
//!
//! A frame is an inlier if it does not contradict the inliers that it shares wall with, and if
//! pairs that show the same wall connect it with the others. Agreement of neighbours is not enough:
//! a group of frames can be right in itself and stand in the wrong place, if all that it shares
//! with the others is a strip that contradicts, or the prior. The relation of a rig's cameras
//! connects them as a pair does, if it is known as well.

use crate::model::context::EstimationContext;
use crate::model::rejection::RejectionReason;
use crate::thresholds::inconsistent_frames::{MAX_CONTRADICTING_SHARE, MAX_RELATION_SIGMA_PX};
use crate::validation::pairwise_ncc::PairNcc;
use tunnelstitch_geometry::surface::mean_radius_m;

/// Finds the frames that contradict the others, worst first, and those of the rest that no pair,
/// nor a relation of a rig ([`known_relations`]), connects with the largest group.
pub fn find_inconsistent_frames(
    pairs: &[PairNcc],
    relations: &[(usize, usize)],
    frames: usize,
) -> Vec<(usize, RejectionReason)> {
    let mut rejections = find_contradictions(pairs, frames);
    let mut is_judged = vec![false; frames];
    for pair in pairs {
        (is_judged[pair.a], is_judged[pair.b]) = (true, true);
    }
    for (frame, _) in &rejections {
        is_judged[*frame] = false;
    }
    let same_wall = pairs.iter().filter(|pair| !pair.contradicts);
    let same_wall = same_wall.map(|pair| (pair.a, pair.b));
    let connections = same_wall.chain(relations.iter().copied());
    let connections = connections.filter(|(a, b)| is_judged[*a] && is_judged[*b]);
    let group = connected_components(connections, frames);
    // Frames that share no texture with any other are not judged here.
    let judged: Vec<usize> = (0..frames).filter(|k| is_judged[*k]).collect();
    let mut sizes = vec![0usize; frames];
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

/// Finds the frames that contradict the others, worst first.
///
/// Frames are rejected one by one, always the one with the largest share of its samples in
/// contradicting pairs, until that is at most [`MAX_CONTRADICTING_SHARE`] for every frame.
pub fn find_contradictions(pairs: &[PairNcc], frames: usize) -> Vec<(usize, RejectionReason)> {
    let (mut all, mut contradicting) = (vec![0.0; frames], vec![0.0; frames]);
    let mut of_frame: Vec<Vec<usize>> = vec![Vec::new(); frames];
    for (k, pair) in pairs.iter().enumerate() {
        for frame in [pair.a, pair.b] {
            all[frame] += pair.samples;
            if pair.contradicts {
                contradicting[frame] += pair.samples;
            }
            of_frame[frame].push(k);
        }
    }
    let mut rejected = vec![false; frames];
    let mut rejections = Vec::new();
    loop {
        let worst = (0..frames)
            .filter(|k| !rejected[*k] && contradicting[*k] > MAX_CONTRADICTING_SHARE * all[*k])
            .max_by(|a, b| (contradicting[*a] / all[*a]).total_cmp(&(contradicting[*b] / all[*b])));
        let Some(worst) = worst else {
            return rejections;
        };
        rejected[worst] = true;
        let mut against = (worst, 1.0);
        for pair in of_frame[worst].iter().map(|k| &pairs[*k]) {
            let other = if pair.a == worst { pair.b } else { pair.a };
            if rejected[other] {
                continue;
            }
            all[other] -= pair.samples;
            if pair.contradicts {
                contradicting[other] -= pair.samples;
                if pair.correlation < against.1 {
                    against = (other, pair.correlation);
                }
            }
        }
        rejections.push((
            worst,
            RejectionReason::Contradicts {
                frame: against.0,
                correlation: against.1,
            },
        ));
    }
}

/// Pairs of frames of one moment whose relation is known well enough to connect them: if its σ
/// displaces the wall in the picture by no more than [`MAX_RELATION_SIGMA_PX`].
pub fn known_relations(context: &EstimationContext) -> Vec<(usize, usize)> {
    let Some(rig) = &context.prior.rig else {
        return Vec::new();
    };
    let distance_m = mean_radius_m(context.surface.as_ref());
    let sigma_rad = (rig.rotation_sigma_rad).hypot(rig.translation_sigma_m / distance_m);
    let is_known = |k: &usize| {
        let focal_px = context.cameras.of(*k).vertical_focal_px();
        context.prior.is_related(*k) && focal_px * sigma_rad <= MAX_RELATION_SIGMA_PX
    };
    let later = (1..context.prior.initial.len()).filter(is_known);
    later.map(|k| (k - 1, k)).collect()
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
    use crate::thresholds::pairwise_ncc::MIN_CORRELATION;

    fn find(pairs: &[PairNcc], frames: usize) -> Vec<(usize, RejectionReason)> {
        find_inconsistent_frames(pairs, &[], frames)
    }

    fn pair(a: usize, b: usize, correlation: f64) -> PairNcc {
        PairNcc {
            a,
            b,
            samples: 100.0,
            correlation,
            contradicts: correlation < MIN_CORRELATION,
            sharpness_ratio: Some(1.0),
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
        assert!(find_inconsistent_frames(&pairs, &[(2, 7)], 10).is_empty());
    }
}
