//! Rejection of blurred frames.
//!
//! Of two frames, the one from which the wall is farther, or more oblique, shows less fine detail
//! of it without being blurred: along the tunnel, each frame does than those after it. Averages
//! over pixels of the area A on the wall have a variance that falls by A^−p, with p between 0 for
//! a wall that is smooth over a pixel and 1 for one that has no two points alike. The pairs
//! themselves tell p: with the ratios v of variances and a of areas in the picture, `ln v = p ln a`
//! by least squares.

use crate::comparison::pairwise_ncc::{PairNcc, SharpnessRatio};
use crate::model::rejection::RejectionReason;
use crate::thresholds::pairwise_ncc::MIN_SHARPNESS_RATIO;

/// Finds the frames that show less fine detail than the frames that they overlap.
pub fn find_blurred_frames(pairs: &[PairNcc], frames: usize) -> Vec<(usize, RejectionReason)> {
    let power = power_of_area(pairs.iter().filter_map(|pair| pair.sharpness));
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); frames];
    for (pair, sharpness) in pairs.iter().filter_map(|p| Some((p, p.sharpness?))) {
        let ratio = sharpness.variance / sharpness.area.powf(power);
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

/// The power p of the area by which the variance of fine detail grows, 0 to 1.
fn power_of_area(ratios: impl Iterator<Item = SharpnessRatio>) -> f64 {
    let (mut xx, mut xy) = (0.0, 0.0);
    for SharpnessRatio { variance, area } in ratios {
        let (x, y) = (area.ln(), variance.max(f64::MIN_POSITIVE).ln());
        xx += x * x;
        xy += x * y;
    }
    (xy / f64::max(xx, f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(a: usize, b: usize, variance: f64, area: f64) -> PairNcc {
        PairNcc {
            a,
            b,
            samples: 100.0,
            correlation: 0.9,
            contradicts: false,
            sharpness: Some(SharpnessRatio { variance, area }),
        }
    }

    #[test]
    fn frame_without_fine_detail_is_blurred() {
        let pairs = [
            pair(0, 1, 5.0, 1.0),
            pair(1, 2, 0.2, 1.01),
            pair(0, 2, 1.0, 1.01),
        ];
        let blurred = find_blurred_frames(&pairs, 3);
        assert_eq!(blurred.len(), 1);
        assert_eq!(blurred[0].0, 1);
    }

    /// Along the tunnel, each frame sees the wall from farther away than those after it. One of
    /// them is blurred.
    #[test]
    fn a_frame_that_is_farther_away_is_not_blurred() {
        let blur = |frame: usize| if frame == 5 { 0.2 } else { 1.0 };
        let pairs: Vec<PairNcc> = (0..12)
            .flat_map(|a| (a + 1..(a + 4).min(12)).map(move |b| (a, b)))
            .map(|(a, b)| {
                let area = 0.6f64.powi((b - a) as i32);
                pair(a, b, blur(a) / blur(b) * area.powf(0.9), area)
            })
            .collect();
        let blurred = find_blurred_frames(&pairs, 12);
        assert!(matches!(blurred[..], [(5, _)]), "{blurred:?}");
    }
}
