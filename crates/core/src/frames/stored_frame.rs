//! Grey values of frames in the bit depth of their files.

use super::decode::load_colour;
use super::error::FrameError;
use super::frame_file::FrameFile;
use super::grey::GreyImage;
use image::DynamicImage;

/// A decoded frame that takes a quarter (8 bits) or half (16 bits, colour) of the memory of a
/// [`GreyImage`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredFrame {
    width: usize,
    height: usize,
    values: Values,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Values {
    Eight(Vec<u8>),
    Sixteen(Vec<u16>),
}

/// Luma of red, green and blue.
///
/// Source: ITU-R BT.709-6, 2015, item 3.2.
const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Rec. 709 luma of a picture, in 16 bits. That of 8-bit RGB, as nearly all colour frames have, is
/// computed here: with the general conversion `check` takes a quarter longer.
fn luma_of(picture: &DynamicImage) -> Vec<u16> {
    match picture {
        DynamicImage::ImageRgb8(rgb) => {
            let luma = |pixel: &[u8]| {
                let terms = pixel.iter().zip(LUMA);
                257.0 * terms.map(|(v, weight)| f32::from(*v) * weight).sum::<f32>()
            };
            let pixels = rgb.as_raw().chunks_exact(3);
            pixels.map(|pixel| (luma(pixel) + 0.5) as u16).collect()
        }
        other => {
            let luma = other.to_luma32f().into_raw().into_iter();
            // The cast saturates.
            luma.map(|v| (v * 65535.0).round() as u16).collect()
        }
    }
}

impl StoredFrame {
    /// Decodes a frame and checks its size. Colour becomes Rec. 709 luma of 16 bits.
    ///
    /// # Errors
    /// The errors of [`load_colour`].
    pub fn decode(file: &FrameFile, width: u32, height: u32) -> Result<Self, FrameError> {
        let values = match load_colour(file, width, height)? {
            DynamicImage::ImageLuma8(grey) => Values::Eight(grey.into_raw()),
            DynamicImage::ImageLuma16(grey) => Values::Sixteen(grey.into_raw()),
            colour => Values::Sixteen(luma_of(&colour)),
        };
        Ok(Self {
            width: width as usize,
            height: height as usize,
            values,
        })
    }

    /// Converts to grey levels, 0 to 255; 16 bits keep their finer steps (65535 = 255 · 257).
    ///
    /// Full white and full black become NaN: they are clipped by the sensor or the encoder and only
    /// bound the brightness of the wall.
    pub fn grey(&self) -> GreyImage {
        let data = match &self.values {
            Values::Eight(values) => {
                let level = |v: &u8| match *v {
                    0 | u8::MAX => f32::NAN,
                    v => f32::from(v),
                };
                values.iter().map(level).collect()
            }
            Values::Sixteen(values) => {
                let level = |v: &u16| match *v {
                    0 | u16::MAX => f32::NAN,
                    v => f32::from(v) / 257.0,
                };
                values.iter().map(level).collect()
            }
        };
        GreyImage::new(self.width, self.height, data)
    }

    /// Converts to grey levels, 0 to 255, as [`StoredFrame::grey`] does, but clipped pixels keep
    /// their values.
    pub fn grey_with_clipped(&self) -> GreyImage {
        let data = match &self.values {
            Values::Eight(values) => values.iter().map(|v| f32::from(*v)).collect(),
            Values::Sixteen(values) => values.iter().map(|v| f32::from(*v) / 257.0).collect(),
        };
        GreyImage::new(self.width, self.height, data)
    }

    /// The brightest value of a frame of 16 bits; None of one of 8 bits.
    pub fn brightest(&self) -> Option<u16> {
        match &self.values {
            Values::Eight(_) => None,
            Values::Sixteen(values) => values.iter().copied().max(),
        }
    }

    /// Memory in use, bytes.
    pub fn bytes(&self) -> usize {
        match &self.values {
            Values::Eight(values) => values.len(),
            Values::Sixteen(values) => 2 * values.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::write::{PictureFormat, write_picture};
    use image::ImageBuffer;

    fn stored(picture: &DynamicImage) -> StoredFrame {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.png");
        write_picture(&path, picture, PictureFormat::Png).unwrap();
        let file = FrameFile::picture(0, path);
        StoredFrame::decode(&file, picture.width(), picture.height()).unwrap()
    }

    fn grey_of(picture: &DynamicImage) -> GreyImage {
        stored(picture).grey()
    }

    #[test]
    fn sixteen_bits_keep_their_fractions_of_grey_levels() {
        // Every possible value.
        let all = ImageBuffer::from_fn(256, 256, |u, v| image::Luma([(256 * v + u) as u16]));
        let grey = grey_of(&all.into());
        let last = grey.data().len() - 1;
        for (value, level) in grey.data().iter().enumerate().take(last).skip(1) {
            assert_eq!((f64::from(*level) * 257.0).round() as usize, value);
        }
        // Black and white are clipped.
        assert!(grey.data()[0].is_nan() && grey.data()[last].is_nan());
        for level in 1..255u16 {
            assert_eq!(grey.data()[usize::from(257 * level)], f32::from(level));
        }
    }

    #[test]
    fn clipped_pixels_can_keep_their_values() {
        let ramp = image::GrayImage::from_fn(256, 1, |u, _| image::Luma([u as u8]));
        let values: Vec<f32> = (0..256).map(|value| value as f32).collect();
        assert_eq!(stored(&ramp.into()).grey_with_clipped().data(), values);
        let sixteen = ImageBuffer::from_fn(256, 1, |u, _| image::Luma([257 * u as u16]));
        assert_eq!(stored(&sixteen.into()).grey_with_clipped().data(), values);
    }

    #[test]
    fn grey_in_colour_is_grey() {
        let ramp = |u: u32| u as u8;
        let grey: DynamicImage =
            image::GrayImage::from_fn(256, 1, |u, _| image::Luma([ramp(u)])).into();
        let colour: DynamicImage =
            image::RgbImage::from_fn(256, 1, |u, _| image::Rgb([ramp(u); 3])).into();
        for (a, b) in grey_of(&grey).data().iter().zip(grey_of(&colour).data()) {
            assert!((a - b).abs() < 0.003 || a.is_nan() && b.is_nan(), "{a} {b}");
        }
    }

    /// Against the general conversion, over the cube of colours: its weights, of more digits, make
    /// a hundredth of a grey level at the most.
    #[test]
    fn luma_of_eight_bits_is_that_of_the_general_conversion() {
        let colours = image::RgbImage::from_fn(52, 52, |x, y| {
            let blue = (x / 4 * 13 + y / 4) as u8;
            image::Rgb([(5 * x) as u8, (5 * y) as u8, blue])
        });
        let picture = DynamicImage::from(colours);
        let luma = luma_of(&picture);
        assert_eq!(luma.len(), 52 * 52);
        for (luma, general) in luma.iter().zip(picture.to_luma32f().as_raw()) {
            assert!((f32::from(*luma) - 65535.0 * general).abs() < 3.5);
        }
        let white = DynamicImage::from(image::RgbImage::from_pixel(2, 1, image::Rgb([255; 3])));
        assert_eq!(luma_of(&white), [65535; 2]);
    }
}
