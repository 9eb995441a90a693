//! Channels and depth of pictures.

use super::sample::Sample;
use image::ColorType;
use serde::{Deserialize, Serialize};

/// Channels and depth of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PixelFormat {
    /// 1 (grey) or 3 (red, green, blue).
    pub channels: usize,
    /// 16 bits a sample instead of 8.
    pub deep: bool,
}

impl PixelFormat {
    /// Format in which pictures of a file's colour type are held: grey stays grey and everything
    /// else becomes colour, 16 bits stay 16 and everything else becomes 8.
    pub fn of(colour: ColorType) -> Self {
        Self {
            channels: if colour.has_color() { 3 } else { 1 },
            deep: matches!(
                colour,
                ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16
            ),
        }
    }

    /// Smallest format that holds both.
    pub fn and(self, other: Self) -> Self {
        Self {
            channels: self.channels.max(other.channels),
            deep: self.deep || other.deep,
        }
    }

    /// Full scale.
    pub fn white(self) -> f32 {
        if self.deep { u16::WHITE } else { u8::WHITE }
    }

    /// Grey value, 0 to 255, of values side by side: Rec. 709 luma of colour.
    pub fn grey(self, [first, second, third, _]: [f32; 4]) -> f32 {
        let value = match self.channels {
            1 => first,
            _ => luma([first, second, third]),
        };
        value * (255.0 / self.white())
    }

    /// Bytes of a sample.
    pub fn sample_bytes(self) -> usize {
        if self.deep { 2 } else { 1 }
    }

    /// Bytes of a pixel, with its alpha if it has one.
    pub fn pixel_bytes(self, alpha: bool) -> usize {
        (self.channels + usize::from(alpha)) * self.sample_bytes()
    }
}

/// Rec. 709 luma: `0.2126 R + 0.7152 G + 0.0722 B`.
pub(crate) fn luma([red, green, blue]: [f32; 3]) -> f32 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}
