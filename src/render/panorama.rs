//! The finished panorama.

use super::picture::luma;
use super::{Canvas, Layout};
use crate::frames::GreyImage;
use image::{DynamicImage, GrayAlphaImage, RgbaImage};

/// A panorama: 8-bit samples with an alpha that is 255 where some frame sees the wall and 0 in holes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    canvas: Canvas,
    /// 1 (grey) or 3 (colour), not counting alpha.
    channels: usize,
    /// Row-major as [`Layout::ThetaRight`], alpha last.
    pixels: Vec<u8>,
}

impl Panorama {
    /// A panorama from its pixels, `channels` samples and alpha each.
    pub(super) fn new(canvas: Canvas, channels: usize, pixels: Vec<u8>) -> Self {
        debug_assert_eq!(pixels.len(), canvas.pixels() * (channels + 1));
        Self {
            canvas,
            channels,
            pixels,
        }
    }

    /// Its place on the wall.
    pub fn canvas(&self) -> &Canvas {
        &self.canvas
    }

    /// Share of the pixels that some frame sees, 0–1.
    pub fn coverage(&self) -> f64 {
        let step = self.channels + 1;
        let covered = self
            .pixels
            .chunks_exact(step)
            .filter(|pixel| pixel[self.channels] != 0)
            .count();
        covered as f64 / self.canvas.pixels() as f64
    }

    /// Grey values (Rec. 709 luma of colour; 0 in holes) and which pixels are covered, row-major as
    /// [`Layout::ThetaRight`].
    pub fn grey(&self) -> (GreyImage, Vec<bool>) {
        let pixels = self.pixels.chunks_exact(self.channels + 1);
        let covered = pixels
            .clone()
            .map(|pixel| pixel[self.channels] != 0)
            .collect();
        let grey = pixels
            .map(|pixel| match *pixel {
                [red, green, blue, _] => luma([red, green, blue].map(f32::from)),
                [grey, ..] => f32::from(grey),
                [] => 0.0,
            })
            .collect();
        let (width, height) = (self.canvas.columns as usize, self.canvas.rows as usize);
        (GreyImage::new(width, height, grey), covered)
    }

    /// The picture to be written: grey or red-green-blue, with alpha.
    pub fn into_image(self, layout: Layout) -> DynamicImage {
        let (width, height) = (self.canvas.columns, self.canvas.rows);
        // The length was checked when the panorama was made, so the pictures exist.
        let image = if self.channels == 1 {
            GrayAlphaImage::from_raw(width, height, self.pixels).map(DynamicImage::from)
        } else {
            RgbaImage::from_raw(width, height, self.pixels).map(DynamicImage::from)
        }
        .unwrap_or_default();
        layout.turn(image)
    }
}
