//! Readings of picture files: the brightness of white, and the orientation.

use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, Pixel};
use serde::{Deserialize, Serialize};

/// `[frames] orientation`: orientation of the pictures against that in which they are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PictureOrientation {
    /// As stored.
    #[default]
    Stored,
    /// As displayed: turned as EXIF says.
    Exif,
    /// Turned upside down.
    Turned180,
    /// Mirrored: left is right.
    Mirrored,
    /// Mirrored and upside down.
    Flipped,
}

impl PictureOrientation {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stored => "stored",
            Self::Exif => "exif",
            Self::Turned180 => "turned180",
            Self::Mirrored => "mirrored",
            Self::Flipped => "flipped",
        }
    }

    /// A picture without EXIF data, turned.
    pub fn turned(self, picture: &DynamicImage) -> DynamicImage {
        let mut picture = picture.clone();
        picture.apply_orientation(self.turn(Orientation::NoTransforms));
        picture
    }

    /// Transformation of a stored picture whose EXIF data name `tag`.
    pub(super) fn turn(self, tag: Orientation) -> Orientation {
        match self {
            Self::Stored => Orientation::NoTransforms,
            Self::Exif => tag,
            Self::Turned180 => Orientation::Rotate180,
            Self::Mirrored => Orientation::FlipHorizontal,
            Self::Flipped => Orientation::FlipVertical,
        }
    }
}

/// Reading of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureReading {
    /// Value of white in files of 16 bits; 4095 where they hold values of 12 bits.
    pub white: u16,
    /// The orientation.
    pub orientation: PictureOrientation,
}

impl Default for PictureReading {
    fn default() -> Self {
        Self {
            white: u16::MAX,
            orientation: PictureOrientation::default(),
        }
    }
}

impl PictureReading {
    /// Scales the values of a picture of 16 bits, so that white is 65535.
    ///
    /// # Errors
    /// A picture that is brighter than white, in words.
    pub(super) fn scale(&self, mut picture: DynamicImage) -> Result<DynamicImage, String> {
        if self.white == u16::MAX {
            return Ok(picture);
        }
        let brightest = match &mut picture {
            DynamicImage::ImageLuma16(picture) => scale_values(picture, self.white),
            DynamicImage::ImageLumaA16(picture) => scale_values(picture, self.white),
            DynamicImage::ImageRgb16(picture) => scale_values(picture, self.white),
            DynamicImage::ImageRgba16(picture) => scale_values(picture, self.white),
            _ => 0,
        };
        if brightest > self.white {
            let bits = u16::BITS - self.white.leading_zeros();
            return Err(format!(
                "it has the value {brightest}, but frames.bits = {bits} allows no more than {}",
                self.white
            ));
        }
        Ok(picture)
    }
}

/// Scales the colours of a picture; returns its brightest value before.
fn scale_values<P: Pixel<Subpixel = u16>>(
    picture: &mut ImageBuffer<P, Vec<u16>>,
    white: u16,
) -> u16 {
    let mut brightest = 0;
    let mut scaled = |value: u16| {
        brightest = brightest.max(value);
        let (value, white) = (u32::from(value.min(white)), u32::from(white));
        // Rounded; it is no more than 65535.
        ((value * u32::from(u16::MAX) + white / 2) / white) as u16
    };
    for pixel in picture.pixels_mut() {
        pixel.apply_with_alpha(&mut scaled, |alpha| alpha);
    }
    brightest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{FrameError, FrameFile, load_colour};
    use image::{GrayImage, Luma};

    fn read(picture: &DynamicImage, reading: PictureReading) -> Result<DynamicImage, FrameError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.png");
        picture.save(&path).unwrap();
        let frame = FrameFile::picture(0, path).with_reading(reading);
        load_colour(&frame, picture.width(), picture.height())
    }

    #[test]
    fn values_of_twelve_bits_reach_from_black_to_white() {
        let ramp = |u: u32| [0u16, 1, 2048, 4095][u as usize];
        let picture: DynamicImage = ImageBuffer::from_fn(4, 1, |u, _| Luma([ramp(u)])).into();
        let twelve = PictureReading {
            white: 4095,
            ..PictureReading::default()
        };
        let scaled = read(&picture, twelve).unwrap().into_luma16().into_raw();
        assert_eq!(scaled, [0, 16, 32776, 65535]);
        assert_eq!(read(&picture, PictureReading::default()).unwrap(), picture);
        let eleven = PictureReading {
            white: 2047,
            ..PictureReading::default()
        };
        let said = read(&picture, eleven).unwrap_err().to_string();
        assert!(
            said.contains("4095") && said.contains("bits = 11"),
            "{said}"
        );
        // Eight bits stay as they are.
        let eight: DynamicImage = GrayImage::from_pixel(2, 2, Luma([9])).into();
        assert_eq!(read(&eight, twelve).unwrap(), eight);
    }
}
