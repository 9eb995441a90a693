//! Estimation of sensor noise from single images.

use super::grey::GreyImage;
use super::pyramid::Pyramid;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::median::{MAD_TO_SIGMA, upper_median};

/// Step of rows and columns at which the noise is sampled.
const SAMPLING_STRIDE: usize = 3;

/// Pyramid levels at which the noise of a picture is measured, from full size on.
const MEASURED_LEVELS: usize = 3;
/// Growth of the variance that texture shows from one level to the next: that of natural pictures,
/// whose power spectra fall with the square of the frequency.
const TEXTURE_GROWTH: f64 = 4.0;

/// Noise that the levels of a picture show, each as 1-σ of the white noise at full size of which it
/// would show as much, grey levels. Texture counts as noise, the more, the coarser the level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseMeasurement([f64; MEASURED_LEVELS]);

impl NoiseMeasurement {
    /// Measures a picture. Levels that it does not have show what the one before shows. None if no
    /// pixel has a value.
    pub fn of(pyramid: &Pyramid) -> Option<Self> {
        let mut sigmas = [noise_sigma(pyramid.level(0))?; MEASURED_LEVELS];
        for level in 1..MEASURED_LEVELS {
            let found = (level < pyramid.levels()).then(|| noise_sigma(pyramid.level(level)));
            let found = found.flatten().map(|sigma| sigma / mask_response(level));
            sigmas[level] = found.unwrap_or(sigmas[level - 1]);
        }
        Some(Self(sigmas))
    }
}

/// 1-σ of the noise of pictures, in grey levels of a pixel at full size.
///
/// Compression (JPEG, video) leaves out the finest noise, as nobody sees it, and keeps what is
/// coarser. At quality 90, white noise of 3 grey levels in a dark picture looks like one of 0.7 by
/// its finest detail, and like one of 3.2 at all coarser levels. What grows from level to level is
/// texture. With variances `n² + t²` and `n² + G t²` of two levels,
///
/// `n² = (G (n² + t²) − (n² + G t²))/(G − 1)`,   `G = 4`.
///
/// Source: D. J. Field, "Relations between the statistics of natural images and the response
/// properties of cortical cells", Journal of the Optical Society of America A 4(12), 1987 (the
/// spectra).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureNoise {
    /// That of the finest detail.
    pub fine: f64,
    /// White noise of which coarser levels show as much; no less than the finest.
    pub coarse: f64,
}

impl PictureNoise {
    /// The noise by the median measurements of pictures; none if there are none.
    pub fn median(pictures: &[NoiseMeasurement]) -> Self {
        let median = |level: usize| {
            let sigmas = pictures.iter().map(|picture| picture.0[level]);
            upper_median(sigmas.collect()).unwrap_or_default()
        };
        let fine = median(0);
        let [half, quarter] = [1, 2].map(|level| median(level).powi(2));
        let noise = (TEXTURE_GROWTH * half - quarter) / (TEXTURE_GROWTH - 1.0);
        Self {
            fine,
            coarse: noise.clamp(fine * fine, half.max(fine * fine)).sqrt(),
        }
    }

    /// The mean of the noise of several stretches of a survey; none if there are none.
    pub fn mean(stretches: &[Self]) -> Self {
        let count = stretches.len().max(1) as f64;
        let mean = |sigma: fn(&Self) -> f64| stretches.iter().map(sigma).sum::<f64>() / count;
        Self {
            fine: mean(|noise| noise.fine),
            coarse: mean(|noise| noise.coarse),
        }
    }

    /// Mean variance of a bilinear sample at a pyramid level, grey levels².
    pub fn variance_at(&self, level: usize) -> f64 {
        let sigma = if level == 0 { self.fine } else { self.coarse };
        sigma * sigma * noise_at_level(level)
    }
}

/// 1-σ of what the mask of [`noise_sigma`] finds at a pyramid level, over that of white noise at
/// full size.
fn mask_response(level: usize) -> f64 {
    let (kernel, step) = (level_kernel(level), 1 << level);
    let at = |n: usize, shift: usize| {
        let tap = n.checked_sub(shift * step).and_then(|tap| kernel.get(tap));
        tap.copied().unwrap_or_default()
    };
    let taps = 0..kernel.len() + 2 * step;
    let response = taps.map(|n| (at(n, 0) - 2.0 * at(n, 1) + at(n, 2)).powi(2));
    // Of 6 by the mask alone along each of two axes.
    response.sum::<f64>() / 6.0
}

/// Estimates the 1-σ noise of an image, grey levels: the median of `|M ∗ I|` with the mask
/// `M = [1 −2 1; −2 4 −2; 1 −2 1]`, which vanishes on planes and on straight edges along an axis;
/// white noise has 6 σ after the filter.
///
/// Source: J. Immerkær, "Fast noise variance estimation", Computer Vision and Image Understanding
/// 64(2), 1996; with the median instead of the mean, for robustness against edges.
pub fn noise_sigma(image: &GreyImage) -> Option<f64> {
    let (w, h) = (image.width(), image.height());
    let mut found = Vec::new();
    for y in (1..h.saturating_sub(1)).step_by(SAMPLING_STRIDE) {
        for x in (1..w.saturating_sub(1)).step_by(SAMPLING_STRIDE) {
            let row = |y: usize| image.at(x - 1, y) - 2.0 * image.at(x, y) + image.at(x + 1, y);
            let response = (row(y - 1) - 2.0 * row(y) + row(y + 1)).abs();
            if !response.is_nan() {
                found.push(response);
            }
        }
    }
    if found.is_empty() {
        return None;
    }
    let middle = found.len() / 2;
    let (_, median, _) = found.select_nth_unstable_by(middle, f32::total_cmp);
    Some(MAD_TO_SIGMA * f64::from(*median) / 6.0)
}

/// Mean variance of a bilinear sample at a pyramid level relative to the variance of a pixel at
/// full resolution.
///
/// Each level filters with `[1 3 3 1]/8` along each axis and takes every other pixel. A sample at
/// fraction f mixes two neighbours whose noise correlates by ρ: on average over f, the fraction
/// `2/3 + ρ/3` of the variance remains.
pub fn noise_at_level(level: usize) -> f64 {
    let kernel = level_kernel(level);
    let product = |shift: usize| -> f64 {
        kernel
            .iter()
            .zip(kernel.iter().skip(shift))
            .map(|(a, b)| a * b)
            .sum()
    };
    let axis = 2.0 / 3.0 * product(0) + product(1 << level) / 3.0;
    axis * axis
}

/// The weights along an axis with which pixels at full size make one at a pyramid level.
fn level_kernel(level: usize) -> Vec<f64> {
    let mut kernel = vec![1.0f64];
    for k in 0..level {
        // The taps of a level lie 2^k pixels apart.
        let step = 1usize << k;
        let mut next = vec![0.0; kernel.len() + 3 * step];
        for (tap, weight) in [1.0, 3.0, 3.0, 1.0].iter().enumerate() {
            for (n, value) in kernel.iter().enumerate() {
                next[n + tap * step] += weight / 8.0 * value;
            }
        }
        kernel = next;
    }
    kernel
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    fn noisy(sigma: f32, wall: fn(usize, usize) -> f32) -> GreyImage {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let noise = Normal::new(0.0, sigma).unwrap();
        let data = (0..256 * 256).map(|k| wall(k % 256, k / 256) + noise.sample(&mut rng));
        GreyImage::new(256, 256, data.collect())
    }

    #[test]
    fn noise_is_found_under_edges_and_light() {
        let image = noisy(3.0, |x, y| {
            100.0 + 0.2 * x as f32 - 0.1 * y as f32
                + if (x / 17 + y / 11) % 2 == 0 {
                    40.0
                } else {
                    0.0
                }
        });
        let sigma = noise_sigma(&image).unwrap();
        assert!((sigma / 3.0 - 1.0).abs() < 0.1, "{sigma}");
    }

    /// A picture with the upper three of the eight frequencies of a block left out along both axes,
    /// as compression does.
    fn compressed(image: &GreyImage) -> GreyImage {
        let basis = |u: usize, x: usize| {
            let scale = if u == 0 { 0.125f32 } else { 0.25 }.sqrt();
            scale * (std::f32::consts::PI * (x as f32 + 0.5) * u as f32 / 8.0).cos()
        };
        let kept = |x: usize, from: usize| -> f32 {
            let frequencies = 0..5;
            frequencies.map(|u| basis(u, x) * basis(u, from)).sum()
        };
        let along = |n: usize, at: &dyn Fn(usize) -> f32| -> f32 {
            let block = 0..8;
            let of_block = block.map(|from| kept(n % 8, from) * at(n / 8 * 8 + from));
            of_block.sum()
        };
        let (width, height) = (image.width(), image.height());
        let data = (0..width * height).map(|k| {
            let (x, y) = (k % width, k / width);
            along(y, &|row| along(x, &|column| image.at(column, row)))
        });
        GreyImage::new(width, height, data.collect())
    }

    #[test]
    fn noise_without_its_finest_detail_is_found_at_coarser_levels() {
        let found = |image: &GreyImage| {
            let pyramid = Pyramid::new(image.clone(), MEASURED_LEVELS);
            PictureNoise::median(&[NoiseMeasurement::of(&pyramid).unwrap()])
        };
        let white = noisy(3.0, |_, _| 0.0);
        let of_white = found(&white);
        assert!((of_white.fine / 3.0 - 1.0).abs() < 0.1, "{of_white:?}");
        assert!((of_white.coarse / 3.0 - 1.0).abs() < 0.1, "{of_white:?}");
        let of_compressed = found(&compressed(&white));
        assert!(of_compressed.fine < 1.5, "{of_compressed:?}");
        let ratio = of_compressed.coarse / 3.0;
        assert!((ratio - 1.0).abs() < 0.2, "{of_compressed:?}");
        let by_fine = of_compressed.fine.powi(2) * noise_at_level(1);
        assert!(of_compressed.variance_at(1) > 2.0 * by_fine);
        // Texture, which grows from level to level, is no noise.
        let wall = |x: usize, y: usize| {
            let (x, y) = (x as f32, y as f32);
            let wave = |length: f32| {
                let k = std::f32::consts::TAU / length;
                0.5 * length * (k * (x + 0.7 * y)).sin() * (k * (y - 0.6 * x)).cos()
            };
            128.0 + wave(5.0) + wave(9.0) + wave(17.0) + wave(34.0)
        };
        let textured = found(&noisy(0.5, wall));
        assert!(textured.coarse < 1.2, "{textured:?}");
    }

    #[test]
    fn a_picture_of_a_single_level_shows_what_it_shows() {
        let pyramid = Pyramid::new(noisy(3.0, |_, _| 0.0), 1);
        let found = PictureNoise::median(&[NoiseMeasurement::of(&pyramid).unwrap()]);
        assert_eq!(found.coarse, found.fine);
        assert_eq!(PictureNoise::median(&[]), PictureNoise::default());
        let twice = PictureNoise::mean(&[found, found]);
        assert!((twice.fine - found.fine).abs() < 1e-12);
    }

    #[test]
    fn levels_thin_the_noise_as_predicted() {
        let mut image = noisy(3.0, |_, _| 0.0);
        for level in 0..3 {
            let (mut sum, mut n) = (0.0f64, 0.0f64);
            for y in 1..image.height() - 2 {
                for x in 1..image.width() - 2 {
                    let f = [0.1, 0.3, 0.5, 0.7, 0.9];
                    let (fx, fy) = (f[(x * 7 + y) % 5], f[(x + y * 3) % 5]);
                    let a = image.at(x, y) * (1.0 - fx) + image.at(x + 1, y) * fx;
                    let b = image.at(x, y + 1) * (1.0 - fx) + image.at(x + 1, y + 1) * fx;
                    sum += f64::from(a * (1.0 - fy) + b * fy).powi(2);
                    n += 1.0;
                }
            }
            let ratio = sum / n / 9.0 / noise_at_level(level);
            assert!((ratio - 1.0).abs() < 0.12, "level {level}: {ratio}");
            image = image.halved();
        }
    }
}
