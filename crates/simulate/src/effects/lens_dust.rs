//! Dust on the lens: dark soft specks at the same pixels of every frame.

use crate::effects::frame_effect::FrameEffect;
use crate::procedural_noise::RandomStream;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;
use tunnelstitch_core::frames::GreyImage;

/// Range of a speck's radius, at which half of its shadow is left, shares of the frame's height.
const RADIUS: [f64; 2] = [0.008, 0.03];
/// Range of the share of the light that a speck takes at its middle.
const DEPTH: [f64; 2] = [0.3, 0.7];
/// Half the width of a speck's edge, as a share of its radius.
const EDGE: f64 = 0.5;

/// Speck on the lens, far out of focus.
struct Speck {
    /// Middle (u, v), pixels.
    middle: [f64; 2],
    radius_px: f64,
    depth: f64,
}

impl Speck {
    /// Share of the light that passes at a pixel: `3t² − 2t³` across the edge.
    fn transmission(&self, u: f64, v: f64) -> f64 {
        let distance = (u - self.middle[0]).hypot(v - self.middle[1]) / self.radius_px;
        let t = ((1.0 + EDGE - distance) / (2.0 * EDGE)).clamp(0.0, 1.0);
        1.0 - self.depth * t * t * (3.0 - 2.0 * t)
    }
}

/// Transmission of a dusty lens.
pub(super) struct LensDust {
    /// Transmission of each pixel, row-major.
    transmission: Vec<f32>,
}

impl LensDust {
    /// Specks that cover `percent` of frames of `width × height` pixels.
    ///
    /// The specks are a Boolean model: those of total area A on a field of area B cover the share
    /// `1 − exp(−A/B)`. The field is the frame with a margin of the largest radius, so that specks
    /// reach across the border as well.
    pub fn new(seed: u64, percent: f64, width: usize, height: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(RandomStream::LensDust.seed(seed));
        // In units of the height, so that finer frames have the same specks.
        let aspect = width as f64 / height as f64;
        let field = (aspect + 2.0 * RADIUS[1]) * (1.0 + 2.0 * RADIUS[1]);
        let mut missing = -(1.0 - percent / 100.0).ln() * field;
        let mut transmission = vec![1.0f32; width * height];
        while missing > 1e-12 {
            let radius = rng
                .random_range(RADIUS[0]..RADIUS[1])
                .min((missing / PI).sqrt());
            missing -= PI * radius * radius;
            let place = |rng: &mut ChaCha8Rng, size: f64| {
                rng.random_range(-RADIUS[1]..size + RADIUS[1]) * height as f64 - 0.5
            };
            let speck = Speck {
                middle: [place(&mut rng, aspect), place(&mut rng, 1.0)],
                radius_px: radius * height as f64,
                depth: rng.random_range(DEPTH[0]..DEPTH[1]),
            };
            shade(&speck, width, height, &mut transmission);
        }
        Self { transmission }
    }
}

/// Multiplies the transmission of the pixels near a speck by that of the speck.
fn shade(speck: &Speck, width: usize, height: usize, transmission: &mut [f32]) {
    let reach = speck.radius_px * (1.0 + EDGE);
    let pixels = |k: usize, size: usize| {
        let from = (speck.middle[k] - reach).max(0.0) as usize;
        let to = (speck.middle[k] + reach + 1.0).max(0.0) as usize;
        from..to.min(size)
    };
    for v in pixels(1, height) {
        for u in pixels(0, width) {
            transmission[v * width + u] *= speck.transmission(u as f64, v as f64) as f32;
        }
    }
}

impl FrameEffect for LensDust {
    fn apply(&self, _frame: usize, mut image: GreyImage) -> GreyImage {
        for (value, share) in image.data_mut().iter_mut().zip(&self.transmission) {
            *value *= share;
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dusty(seed: u64, percent: f64, times: usize) -> GreyImage {
        let (width, height) = (320 * times, 240 * times);
        let even = GreyImage::new(width, height, vec![100.0; width * height]);
        LensDust::new(seed, percent, width, height).apply(3, even)
    }

    /// A speck of the radius r takes as much light as one with sharp edges and an area of 1.05 πr².
    #[test]
    fn specks_cover_the_given_share_softly() {
        for percent in [1.0, 5.0, 20.0] {
            let losses = (0..12).map(|seed| {
                let image = dusty(seed, percent, 1);
                let steps = image.data().windows(2).take(319);
                assert!(steps.clone().all(|pair| (pair[1] - pair[0]).abs() < 45.0));
                100.0 - image.data().iter().sum::<f32>() / image.data().len() as f32
            });
            let loss = f64::from(losses.sum::<f32>()) / 12.0;
            let expected = 1.05 * 0.5 * (DEPTH[0] + DEPTH[1]) * percent;
            assert!((loss / expected - 1.0).abs() < 0.15, "{percent}: {loss}");
        }
        let clean = dusty(7, 0.0, 1);
        assert!(clean.data().iter().all(|value| *value == 100.0));
    }

    #[test]
    fn finer_frames_have_the_same_specks() {
        let (coarse, fine) = (dusty(7, 5.0, 1), dusty(7, 5.0, 3));
        for (u, v) in (0..320 * 240).map(|k| (k % 320, k / 320)) {
            assert!((coarse.at(u, v) - fine.at(3 * u + 1, 3 * v + 1)).abs() < 0.1);
        }
    }
}
