//! Sensor model: noise, saturation and quantisation.

use crate::effects::frame_effect::FrameEffect;
use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
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

/// White noise of the sensor, with a random stream of its own in each frame.
pub(super) struct SensorNoise {
    /// 1-σ, grey levels.
    pub sigma_grey: f64,
    /// Seed of the survey.
    pub seed: u64,
}

impl FrameEffect for SensorNoise {
    fn apply(&self, frame: usize, mut image: GreyImage) -> GreyImage {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(1 + frame as u64);
        // The noise is finite and not negative, as the options are validated.
        if let Ok(noise) = Normal::new(0.0, self.sigma_grey as f32) {
            for value in image.data_mut() {
                *value += noise.sample(&mut rng);
            }
        }
        image
    }
}

/// Saturates an image and rounds it to the bit depth.
pub(crate) fn quantise(image: &GreyImage, bits: BitDepth) -> DynamicImage {
    let (width, height) = (image.width() as u32, image.height() as u32);
    let grey = |u: u32, v: u32| image.at(u as usize, v as usize);
    // The casts saturate.
    match bits {
        BitDepth::Eight => {
            GrayImage::from_fn(width, height, |u, v| Luma([grey(u, v).round() as u8])).into()
        }
        BitDepth::Sixteen => ImageBuffer::from_fn(width, height, |u, v| {
            Luma([(257.0 * grey(u, v)).round() as u16])
        })
        .into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digitised(bits: BitDepth, sigma_grey: f64) -> DynamicImage {
        let exact = GreyImage::new(3, 2, vec![-7.0, 0.4, 77.25, 100.5, 254.9, 300.0]);
        let noise = SensorNoise {
            sigma_grey,
            seed: 1,
        };
        quantise(&noise.apply(0, exact), bits)
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
