//! Rejection of blurred frames.

use crate::comparison::pairwise_ncc::PairNcc;
use crate::model::rejection::RejectionReason;
use crate::thresholds::pairwise_ncc::MIN_SHARPNESS_RATIO;

/// Finds the frames that show less fine detail than the frames that they overlap.
pub fn find_blurred_frames(pairs: &[PairNcc], frames: usize) -> Vec<(usize, RejectionReason)> {
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); frames];
    for (pair, ratio) in pairs.iter().filter_map(|p| Some((p, p.sharpness_ratio?))) {
        ratios[pair.a].push(ratio);
        ratios[pair.b].push(1.0 / ratio);
    }
    ratios
        .into_iter()
        .enumerate()
        .filter_map(|(frame, mut ratios)| {
            ratios.sort_unstable_by(f64::total_cmp);
            let share = *ratios.get(ratios.len() / 2)?;
            (share < MIN_SHARPNESS_RATIO).then_some((frame, RejectionReason::Blurred { share }))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(a: usize, b: usize, sharpness_ratio: f64) -> PairNcc {
        PairNcc {
            a,
            b,
            samples: 100.0,
            correlation: 0.9,
            contradicts: false,
            sharpness_ratio: Some(sharpness_ratio),
        }
    }

    #[test]
    fn frame_without_fine_detail_is_blurred() {
        let pairs = [pair(0, 1, 5.0), pair(1, 2, 0.2), pair(0, 2, 1.0)];
        let blurred = find_blurred_frames(&pairs, 3);
        assert_eq!(blurred.len(), 1);
        assert_eq!(blurred[0].0, 1);
    }
}
