//! From light to the numbers of a picture file.

use crate::frames::GreyImage;
use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use rand::Rng;
use rand_distr::{Distribution, Normal};
use serde::Serialize;

/// Bits of a frame's grey values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(into = "u8")]
#[non_exhaustive]
pub enum Bits {
    /// 8: a file's values are whole grey levels, 0 to 255.
    #[default]
    Eight,
    /// 16: a file's values are grey level × 257, 0 to 65535.
    Sixteen,
}

impl From<Bits> for u8 {
    /// The number of bits.
    fn from(bits: Bits) -> Self {
        match bits {
            Bits::Eight => 8,
            Bits::Sixteen => 16,
        }
    }
}

/// Adds white noise of 1-σ `noise_grey` (grey levels), saturates, and rounds to the values that so
/// many bits know.
pub(super) fn deliver(
    exact: &GreyImage,
    noise_grey: f64,
    bits: Bits,
    rng: &mut impl Rng,
) -> DynamicImage {
    let (width, height) = (exact.width() as u32, exact.height() as u32);
    // A checked option: the noise is finite and not negative.
    let noise = Normal::new(0.0, noise_grey as f32).ok();
    let mut noisy = |u: u32, v: u32| {
        let noise = noise.map_or(0.0, |noise| noise.sample(rng));
        exact.at(u as usize, v as usize) + noise
    };
    // The casts saturate.
    match bits {
        Bits::Eight => {
            GrayImage::from_fn(width, height, |u, v| Luma([noisy(u, v).round() as u8])).into()
        }
        Bits::Sixteen => ImageBuffer::from_fn(width, height, |u, v| {
            Luma([(257.0 * noisy(u, v)).round() as u16])
        })
        .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn delivered(bits: Bits, noise_grey: f64) -> DynamicImage {
        let exact = GreyImage::new(3, 2, vec![-7.0, 0.4, 77.25, 100.5, 254.9, 300.0]);
        deliver(&exact, noise_grey, bits, &mut ChaCha8Rng::seed_from_u64(1))
    }

    #[test]
    fn values_saturate_and_are_rounded_to_the_bits() {
        let eight = delivered(Bits::Eight, 0.0);
        assert_eq!(
            eight.as_luma8().unwrap().as_raw()[..],
            [0, 0, 77, 101, 255, 255]
        );
        let sixteen = delivered(Bits::Sixteen, 0.0);
        assert_eq!(
            sixteen.as_luma16().unwrap().as_raw()[..],
            [0, 103, 19853, 25829, 65509, 65535]
        );
    }

    /// Noise is in grey levels with any number of bits, and the same noise.
    #[test]
    fn bits_differ_by_the_rounding_only() {
        let (eight, sixteen) = (delivered(Bits::Eight, 3.0), delivered(Bits::Sixteen, 3.0));
        let sixteen = sixteen.as_luma16().unwrap();
        for (fine, coarse) in sixteen.iter().zip(eight.as_luma8().unwrap().iter()) {
            assert!((f64::from(*fine) / 257.0 - f64::from(*coarse)).abs() <= 0.502);
        }
    }
}
