//! Correlation of the contrast that two frames show within patches of the wall.
//!
//! Two frames that are aligned with each other need not show the same wall: joints coincide
//! wherever the pattern of the bricks does, whatever is between them. So their grey values are
//! compared, less the medians of patches that hold a brick or two: smooth light cancels, and a
//! glint displaces nothing.
//!
//! With t the share of the contrast's variance that is texture and not noise, frames of one wall
//! correlate with `r = c t`, c the correlation without noise, 1 but for what changes between
//! frames: light, blur, obliqueness. Of n independent samples, `artanh r` is normal with the
//! variance `1/(n − 3)`.
//!
//! Sources: C. Spearman, "The proof and measurement of association between two things", 1904
//! (correction for attenuation); R. A. Fisher, "On the 'probable error' of a coefficient of
//! correlation deduced from a small sample", Metron 1, 1921.

use crate::thresholds::correlation_search::SAMPLES_PER_INDEPENDENT_PIECE;
use crate::tiles::residual_weighting::{median_and_sigma, robust_correlation};
use crate::tracking::ncc_score::NccScore;

/// The correlation of two frames on the wall that they share.
#[derive(Clone, Copy, Debug)]
pub struct PatchCorrelation {
    /// Correlation r of the contrast, −1 to 1, noise included.
    pub correlation: f64,
    /// Share t of the contrast's variance that is texture, 0 to 1.
    pub texture_share: f64,
    /// Number n of independent samples.
    pub independent: f64,
}

impl PatchCorrelation {
    /// The correlation of pairs of grey values, each given with the number of its patch; `noise`:
    /// the variance of a grey value's noise.
    ///
    /// It is that of all samples or of most, whichever is greater: glints outweigh a faint wall in
    /// the former; where most of the wall is flat, the latter is that of noise.
    pub fn new(
        samples: impl Iterator<Item = (usize, (f32, f32))> + Clone,
        patches: usize,
        noise: f32,
    ) -> Self {
        let of_patches = medians(samples.clone(), patches);
        let contrasts: Vec<(f32, f32)> = samples
            .clone()
            .map(|(patch, (x, y))| {
                let Medians { x: x0, y: y0, .. } = of_patches[patch];
                (x - x0, y - y0)
            })
            .collect();
        let mut score = NccScore::default();
        for ((patch, _), (x, y)) in samples.zip(&contrasts) {
            let noise = noise * (1.0 - MEDIAN_CORRECTION / of_patches[patch].samples as f32);
            score.add((*x, noise), (*y, noise));
        }
        let used = of_patches.iter().filter(|patch| patch.samples > 0).count();
        Self {
            correlation: score.correlation().max(robust_correlation(&contrasts)),
            texture_share: score.texture_share(),
            independent: (score.samples - used as f64) / SAMPLES_PER_INDEPENDENT_PIECE,
        }
    }

    /// The correlation without noise, `r/t`, 1 at the most; 0 without texture.
    pub fn corrected(&self) -> f64 {
        if self.texture_share > 0.0 {
            (self.correlation / self.texture_share).min(1.0)
        } else {
            0.0
        }
    }

    /// True if the correlation without noise is less than `least`, by more than `sigmas` standard
    /// deviations.
    pub fn is_below(&self, least: f64, sigmas: f64) -> bool {
        let freedoms = self.independent - 3.0;
        let expected = (least * self.texture_share).atanh();
        // A correlation of 1 has no finite transform, and is not too small.
        let measured = self.correlation.clamp(-1.0, 1.0).atanh();
        freedoms > 0.0 && measured + sigmas / freedoms.sqrt() < expected
    }
}

/// Share of a sample's variance, over n, that subtracting the median of n normal samples removes:
/// the median has the variance `π/(2n)` and the covariance `1/n` with each of them.
const MEDIAN_CORRECTION: f32 = 2.0 - std::f32::consts::FRAC_PI_2;

/// Medians of the grey values of a patch.
#[derive(Clone, Copy)]
struct Medians {
    samples: usize,
    x: f32,
    y: f32,
}

/// The medians of all patches.
fn medians(samples: impl Iterator<Item = (usize, (f32, f32))>, patches: usize) -> Vec<Medians> {
    let mut values = vec![(Vec::new(), Vec::new()); patches];
    for (patch, (x, y)) in samples {
        values[patch].0.push(x);
        values[patch].1.push(y);
    }
    let median = |values: &mut [f32]| median_and_sigma(values).0;
    let of_patch = |(x, y): &mut (Vec<f32>, Vec<f32>)| Medians {
        samples: x.len(),
        x: median(x),
        y: median(y),
    };
    values.iter_mut().map(of_patch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Two pictures of unit contrast that correlate with 0.9, each with noise of its own of the
    /// variance 1, on light that is brighter from patch to patch.
    fn pictures(count: usize) -> Vec<(usize, (f32, f32))> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut draw = || -> f32 { StandardNormal.sample(&mut rng) };
        let mut picture = |k: usize| {
            let (wall, other) = (draw(), draw());
            let changed = 0.9 * wall + 0.436 * other;
            let light = 20.0 * (k / 16) as f32;
            (k / 16, (wall + draw() + light, changed + draw() - light))
        };
        (0..count).map(&mut picture).collect()
    }

    #[test]
    fn neither_noise_nor_light_lowers_the_correlation() {
        let samples = pictures(8000);
        let found = PatchCorrelation::new(samples.into_iter(), 500, 1.0);
        assert!((found.corrected() - 0.9).abs() < 0.06, "{found:?}");
        assert!((found.texture_share - 0.5).abs() < 0.05, "{found:?}");
        assert!(!found.is_below(0.85, 4.0));
    }

    #[test]
    fn few_samples_decide_nothing() {
        let below = |count: usize| {
            let walls = pictures(2 * count);
            let samples = walls[..count].iter().zip(&walls[count..]);
            let unlike = samples.map(|((patch, (x, _)), (_, (_, y)))| (*patch, (*x, *y)));
            let found = PatchCorrelation::new(unlike, count.div_ceil(16), 0.0);
            assert!(found.corrected().abs() < 0.5, "{found:?}");
            found.is_below(0.7, 4.0)
        };
        assert!(!below(64) && below(1600));
    }
}
