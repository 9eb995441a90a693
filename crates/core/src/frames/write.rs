//! Writing of picture files.

use crate::persist::atomic::{OutputSet, WriteError};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::tiff::TiffEncoder;
use image::{DynamicImage, ImageError, ImageResult};
use std::io::{self, Seek, Write};
use std::path::Path;
use tunnelstitch_geometry::files::printed;

/// An output name without the extension of a supported format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct FormatError(String);

/// A picture format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// `.png`: grey or colour with alpha.
    Png,
    /// `.jpg`, `.jpeg`: 8 bits, lossy; holes are black.
    Jpeg {
        /// 1 to 100.
        quality: u8,
    },
    /// `.tif`, `.tiff`: uncompressed, colour with alpha (grey too, since few programs read grey
    /// with alpha from TIFF).
    Tiff,
}

/// Default quality of JPEG files.
pub const JPEG_QUALITY: u8 = 90;

/// Longest side of a JPEG picture, pixels.
pub const JPEG_LIMIT_PX: u32 = 65_535;

/// Largest number of four-byte pixels addressable by a TIFF's 32-bit offsets, less its header.
const TIFF_LIMIT_PX: u64 = (1 << 30) - (1 << 16);

impl PictureFormat {
    /// The format of a file name's extension.
    ///
    /// # Errors
    /// [`FormatError`] with the remedy for every other name.
    pub fn of(path: &Path) -> Result<Self, FormatError> {
        let extension = path
            .extension()
            .map(|extension| extension.to_string_lossy().to_ascii_lowercase())
            .unwrap_or_default();
        match extension.as_str() {
            "png" => Ok(Self::Png),
            "tif" | "tiff" => Ok(Self::Tiff),
            "jpg" | "jpeg" => Ok(Self::Jpeg {
                quality: JPEG_QUALITY,
            }),
            _ => Err(FormatError(format!(
                "{}: the name must end in .png, .jpg or .tif",
                printed(path)
            ))),
        }
    }
}

/// Writes a picture atomically: the file appears complete or not at all.
///
/// # Errors
/// An error of the operating system or of the encoder.
pub fn write_picture(
    path: &Path,
    image: &DynamicImage,
    format: PictureFormat,
) -> Result<(), WriteError> {
    let mut outputs = OutputSet::default();
    add_picture(&mut outputs, path, image, format)?;
    outputs.commit()
}

/// Adds a picture to a set of outputs.
///
/// # Errors
/// An error of the operating system or of the encoder.
pub fn add_picture(
    outputs: &mut OutputSet,
    path: &Path,
    image: &DynamicImage,
    format: PictureFormat,
) -> Result<(), WriteError> {
    let refuse = |what: &str| {
        let size = format!("{} × {} px", image.width(), image.height());
        let what = format!("{size} are more than {what}, or lower --px-per-metre");
        Err(WriteError::new(path, io::Error::other(what)))
    };
    let longest = image.width().max(image.height());
    if matches!(format, PictureFormat::Jpeg { .. }) && longest > JPEG_LIMIT_PX {
        return refuse("a JPEG file holds; write .tif");
    }
    let pixels = u64::from(image.width()) * u64::from(image.height());
    if format == PictureFormat::Tiff && pixels > TIFF_LIMIT_PX {
        return refuse("a TIFF file holds; write .png");
    }
    outputs.write(path, |writer| {
        encode(image, format, writer).map_err(|error| match error {
            ImageError::IoError(source) => source,
            other => io::Error::other(other),
        })
    })
}

/// Encodes a picture.
fn encode(
    image: &DynamicImage,
    format: PictureFormat,
    writer: &mut (impl Write + Seek),
) -> ImageResult<()> {
    match format {
        PictureFormat::Png => {
            let encoder =
                PngEncoder::new_with_quality(writer, CompressionType::Fast, FilterType::Adaptive);
            image.write_with_encoder(encoder)
        }
        PictureFormat::Jpeg { quality } => {
            let encoder = JpegEncoder::new_with_quality(writer, quality);
            if image.color().has_color() {
                image.to_rgb8().write_with_encoder(encoder)
            } else {
                image.to_luma8().write_with_encoder(encoder)
            }
        }
        PictureFormat::Tiff => {
            DynamicImage::from(image.to_rgba8()).write_with_encoder(TiffEncoder::new(writer))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::GrayAlphaImage;

    #[test]
    fn png_and_tiff_keep_the_holes() {
        let dir = tempfile::tempdir().unwrap();
        let image = GrayAlphaImage::from_raw(2, 1, vec![77, 255, 0, 0]).unwrap();
        let image = DynamicImage::from(image);
        for name in ["a.png", "a.TIF"] {
            let path = dir.path().join(name);
            write_picture(&path, &image, PictureFormat::of(&path).unwrap()).unwrap();
            let again = image::open(&path).unwrap();
            assert_eq!(again.to_rgba8(), image.to_rgba8(), "{name}");
        }
    }

    #[test]
    fn other_formats_are_refused_with_the_remedy() {
        for (name, expected) in [("a", ".png, .jpg or .tif"), ("a.bmp", ".tif")] {
            let message = PictureFormat::of(Path::new(name)).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
