//! Rejection of frames that contradict frames which agree among themselves.

use crate::model::rejection::RejectionReason;
use crate::thresholds::pairwise_ncc::MAX_CONTRADICTING_SHARE;
use crate::validation::pairwise_ncc::PairNcc;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thresholds::pairwise_ncc::MIN_CORRELATION;

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

    #[test]
    fn only_the_contradicting_frame_is_rejected() {
        let mut pairs = Vec::new();
        for a in 0..8usize {
            for b in a + 1..(a + 4).min(8) {
                let wrong = a == 5 || b == 5;
                pairs.push(pair(a, b, if wrong { 0.2 } else { 0.9 }));
            }
        }
        let rejections = find_contradictions(&pairs, 8);
        assert_eq!(rejections.len(), 1);
        assert_eq!(rejections[0].0, 5);
        assert!(find_contradictions(&pairs[..1], 8).is_empty());
    }
}
