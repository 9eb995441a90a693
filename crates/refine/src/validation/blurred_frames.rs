//! Rejection of blurred frames.

use crate::model::rejection::RejectionReason;
use crate::thresholds::blurred_frames::MIN_SHARPNESS_RATIO;
use crate::validation::sharpness::SharpnessRatio;

/// Finds the frames that show less fine detail than the frames that they overlap.
pub fn find_blurred_frames(
    pairs: &[SharpnessRatio],
    frames: usize,
) -> Vec<(usize, RejectionReason)> {
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); frames];
    for SharpnessRatio { a, b, ratio } in pairs {
        ratios[*a].push(*ratio);
        ratios[*b].push(1.0 / ratio);
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

    #[test]
    fn frame_without_fine_detail_is_blurred() {
        let pairs = [(0, 1, 5.0), (1, 2, 0.2), (0, 2, 1.0)];
        let pairs = pairs.map(|(a, b, ratio)| SharpnessRatio { a, b, ratio });
        let blurred = find_blurred_frames(&pairs, 3);
        assert_eq!(blurred.len(), 1);
        assert_eq!(blurred[0].0, 1);
    }
}
