//! Estimation of sensor noise from single images.

use super::grey::GreyImage;
use super::pyramid::Pyramid;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::median::{MAD_TO_SIGMA, upper_median};

/// Step of rows and columns at which the noise is sampled.
const SAMPLING_STRIDE: usize = 3;

/// 1-σ of what the mask of [`noise_sigma`] finds in a picture of half the size, over that of white
/// noise at full size. Along an axis, `[1 3 3 1]/8` and `[1 −2 1]` on every other pixel make
/// `[1 3 1 −5 −5 1 3 1]/8`, which has 18/16 of the variance, for 6 of the mask alone.
const HALF_SIZE_RESPONSE: f64 = 18.0 / 16.0 / 6.0;

/// 1-σ of the noise of pictures, in grey levels of a pixel at full size.
///
/// Compression (JPEG, video) leaves out the finest noise, as nobody sees it, and keeps what is
/// coarser. At quality 90, white noise of 3 grey levels in a dark picture looks like one of 0.7 by
/// its finest detail, and like one of 3.2 in a picture of half the size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureNoise {
    /// That of the finest detail.
    pub fine: f64,
    /// White noise of which a picture of half the size would show as much. It may be fine texture,
    /// which is little beside the coarser texture that has it.
    pub coarse: f64,
}

impl PictureNoise {
    /// Estimates the noise of a picture, by its first two levels if it has them; None if no pixel
    /// has a value.
    pub fn of(pyramid: &Pyramid) -> Option<Self> {
        let fine = noise_sigma(pyramid.level(0))?;
        let half = (pyramid.levels() > 1).then(|| noise_sigma(pyramid.level(1)));
        Some(Self {
            fine,
            coarse: half
                .flatten()
                .map_or(fine, |half| half / HALF_SIZE_RESPONSE),
        })
    }

    /// The median over pictures; no noise if there are none.
    pub fn median(pictures: &[Self]) -> Self {
        let median = |sigma: fn(&Self) -> f64| {
            upper_median(pictures.iter().map(sigma).collect()).unwrap_or_default()
        };
        Self {
            fine: median(|noise| noise.fine),
            coarse: median(|noise| noise.coarse),
        }
    }

    /// Mean variance of a bilinear sample at a pyramid level, grey levels².
    pub fn variance_at(&self, level: usize) -> f64 {
        let sigma = if level == 0 { self.fine } else { self.coarse };
        sigma * sigma * noise_at_level(level)
    }
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

    /// In both sizes if it is white; in half the size only if the finest noise is left out, as
    /// compression does.
    #[test]
    fn noise_without_its_finest_detail_is_found_in_half_the_size() {
        let white = noisy(3.0, |_, _| 0.0);
        let found = |image: &GreyImage| PictureNoise::of(&Pyramid::new(image.clone(), 2)).unwrap();
        let of_white = found(&white);
        assert!((of_white.fine / 3.0 - 1.0).abs() < 0.1, "{of_white:?}");
        assert!((of_white.coarse / 3.0 - 1.0).abs() < 0.1, "{of_white:?}");
        // Of the eight frequencies of a block, the upper three along either axis are left out.
        let basis = |u: usize, x: usize| {
            let scale = if u == 0 { 0.125f32 } else { 0.25 }.sqrt();
            scale * (std::f32::consts::PI * (x as f32 + 0.5) * u as f32 / 8.0).cos()
        };
        let kept =
            |x: usize, from: usize| (0..5).map(|u| basis(u, x) * basis(u, from)).sum::<f32>();
        let smooth = (0..256 * 256).map(|k| {
            let (x, y) = (k % 256, k / 256);
            let along = |n: usize, at: &dyn Fn(usize) -> f32| -> f32 {
                (0..8)
                    .map(|from| kept(n % 8, from) * at(n / 8 * 8 + from))
                    .sum()
            };
            along(y, &|row| along(x, &|column| white.at(column, row)))
        });
        let of_smooth = found(&GreyImage::new(256, 256, smooth.collect()));
        assert!(of_smooth.fine < 1.5, "{of_smooth:?}");
        assert!((of_smooth.coarse / 3.0 - 1.0).abs() < 0.2, "{of_smooth:?}");
        assert!(of_smooth.variance_at(1) > of_smooth.fine.powi(2) * noise_at_level(1));
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
