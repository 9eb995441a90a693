//! Samples of pictures: 8 and 16 bits.

use image::{DynamicImage, ImageBuffer};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use tunnelstitch_geometry::numerics::rounding::ROUNDING_OFFSET;

/// A sample of a picture: 8 or 16 bits.
pub trait Sample: Copy + Default + Send + Sync + std::fmt::Debug + PartialEq + 'static {
    /// Full scale.
    const WHITE: f32;

    /// Converts to a number from 0 to [`Sample::WHITE`].
    fn value(self) -> f32;

    /// Rounds to the nearest sample; numbers beyond the scale become its end (a cubic overshoots at
    /// edges).
    fn nearest(value: f32) -> Self;

    /// Rows of samples as rows of bytes, if they are bytes.
    fn bytes<'a, 'b>(rows: &'a mut [&'b mut [Self]]) -> Option<&'a mut [&'b mut [u8]]>;
}

macro_rules! sample {
    ($($bits:ty, $bytes:expr);*) => {
        $(impl Sample for $bits {
            const WHITE: f32 = <$bits>::MAX as f32;

            #[inline(always)]
            fn value(self) -> f32 {
                f32::from(self)
            }

            #[inline(always)]
            fn nearest(value: f32) -> Self {
                (value.clamp(0.0, Self::WHITE) + ROUNDING_OFFSET).to_bits() as Self
            }

            fn bytes<'a, 'b>(rows: &'a mut [&'b mut [Self]]) -> Option<&'a mut [&'b mut [u8]]> {
                let bytes: for<'c, 'd> fn(
                    &'c mut [&'d mut [Self]],
                ) -> Option<&'c mut [&'d mut [u8]]> = $bytes;
                bytes(rows)
            }
        })*
    };
}

sample!(u8, |rows| Some(rows); u16, |_| None);

/// Zeros at the end of a picture's samples: several samples are read at once.
pub const PADDING: usize = 16;

/// Samples of one kind, row-major, channels interleaved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Samples {
    /// 8 bits.
    Eight(#[serde(with = "serde_bytes")] Vec<u8>),
    /// 16 bits.
    Sixteen(Vec<u16>),
}

impl Samples {
    /// The samples with their eight highest bits.
    pub fn to_eight(&self) -> Cow<'_, [u8]> {
        match self {
            Self::Eight(samples) => samples.into(),
            Self::Sixteen(samples) => samples.iter().map(|v| (v >> 8) as u8).collect(),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        match self {
            Self::Eight(samples) => samples.len(),
            Self::Sixteen(samples) => samples.len(),
        }
    }

    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Converts to a picture of `width × height` pixels: grey (one channel) or red-green-blue, each
    /// pixel's alpha last. It is empty if there are too few samples.
    pub(crate) fn into_image(self, [width, height]: [u32; 2], channels: usize) -> DynamicImage {
        match (self, channels) {
            (Self::Eight(samples), 1) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageLumaA8)
            }
            (Self::Eight(samples), _) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageRgba8)
            }
            (Self::Sixteen(samples), 1) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageLumaA16)
            }
            (Self::Sixteen(samples), _) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageRgba16)
            }
        }
        .unwrap_or_default()
    }

    /// Memory they take, bytes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Eight(samples) => samples.len(),
            Self::Sixteen(samples) => 2 * samples.len(),
        }
    }
}

impl From<Vec<u8>> for Samples {
    fn from(samples: Vec<u8>) -> Self {
        Self::Eight(samples)
    }
}

impl From<Vec<u16>> for Samples {
    fn from(samples: Vec<u16>) -> Self {
        Self::Sixteen(samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_sample_is_nearest_and_within_the_scale() {
        for (value, eight, sixteen) in [
            (-3.0, 0, 0),
            (0.49, 0, 0),
            (0.51, 1, 1),
            (254.6, 255, 255),
            (300.2, 255, 300),
            (65534.7, 255, 65535),
            (1e9, 255, 65535),
        ] {
            assert_eq!((u8::nearest(value), u16::nearest(value)), (eight, sixteen));
        }
    }
}
