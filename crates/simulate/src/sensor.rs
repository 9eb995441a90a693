//! Sensor model: noise, saturation and quantisation.

use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use rand::Rng;
use rand_distr::{Distribution, Normal};
use serde::Serialize;
use tunnelstitch_core::frames::GreyImage;

/// Bit depth of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(into = "u8")]
#[non_exhaustive]
pub enum BitDepth {
    /// 8 bits: values are whole grey levels, 0 to 255.
    #[default]
    Eight,
    /// 16 bits: values are grey level × 257, 0 to 65535.
    Sixteen,
}

impl From<BitDepth> for u8 {
    /// The number of bits.
    fn from(bits: BitDepth) -> Self {
        match bits {
            BitDepth::Eight => 8,
            BitDepth::Sixteen => 16,
        }
    }
}

/// Adds white noise of 1-σ `noise_grey` (grey levels), saturates, and rounds to the bit depth.
pub(super) fn digitise(
    exact: &GreyImage,
    noise_grey: f64,
    bits: BitDepth,
    rng: &mut impl Rng,
) -> DynamicImage {
    let (width, height) = (exact.width() as u32, exact.height() as u32);
    // The noise is finite and not negative, as the options are validated.
    let noise = Normal::new(0.0, noise_grey as f32).ok();
    let mut noisy = |u: u32, v: u32| {
        let noise = noise.map_or(0.0, |noise| noise.sample(rng));
        exact.at(u as usize, v as usize) + noise
    };
    // The casts saturate.
    match bits {
        BitDepth::Eight => {
            GrayImage::from_fn(width, height, |u, v| Luma([noisy(u, v).round() as u8])).into()
        }
        BitDepth::Sixteen => ImageBuffer::from_fn(width, height, |u, v| {
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

    fn digitised(bits: BitDepth, noise_grey: f64) -> DynamicImage {
        let exact = GreyImage::new(3, 2, vec![-7.0, 0.4, 77.25, 100.5, 254.9, 300.0]);
        digitise(&exact, noise_grey, bits, &mut ChaCha8Rng::seed_from_u64(1))
    }

    #[test]
    fn values_saturate_and_are_rounded_to_the_bits() {
        let eight = digitised(BitDepth::Eight, 0.0);
        assert_eq!(
            eight.as_luma8().unwrap().as_raw()[..],
            [0, 0, 77, 101, 255, 255]
        );
        let sixteen = digitised(BitDepth::Sixteen, 0.0);
        assert_eq!(
            sixteen.as_luma16().unwrap().as_raw()[..],
            [0, 103, 19853, 25829, 65509, 65535]
        );
    }

    /// Both bit depths have the same noise, in grey levels.
    #[test]
    fn bits_differ_by_the_rounding_only() {
        let (eight, sixteen) = (
            digitised(BitDepth::Eight, 3.0),
            digitised(BitDepth::Sixteen, 3.0),
        );
        let sixteen = sixteen.as_luma16().unwrap();
        for (fine, coarse) in sixteen.iter().zip(eight.as_luma8().unwrap().iter()) {
            assert!((f64::from(*fine) / 257.0 - f64::from(*coarse)).abs() <= 0.502);
        }
    }
}
