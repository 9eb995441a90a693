//! Bands of a texture in files: drawn by one run, and cut into tiles by another.

use crate::persist::atomic::WriteError;
use crate::persist::checkpoint::Origin;
use crate::persist::part_file::{PartError, read_part, write_part};
use crate::raster::{RasterError, TILE_EDGE_PX};
use crate::render::{Band, Canvas, PixelFormat, RenderError, Samples, Target};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageError, ImageFormat};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

/// A band in a file.
#[derive(Serialize, Deserialize)]
struct StoredBand {
    row: u32,
    rows: u32,
    channels: usize,
    /// Its pixels of 8 bits a sample, with alpha.
    png: Vec<u8>,
}

/// Render target that writes each band into a file of its own, as a part of a result.
pub struct BandFiles<'a> {
    folder: PathBuf,
    origin: &'a Origin,
}

impl<'a> BandFiles<'a> {
    /// A target for the existing `folder`; `origin`: the run whose part the bands are.
    pub fn new(folder: &Path, origin: &'a Origin) -> Self {
        Self {
            folder: folder.to_owned(),
            origin,
        }
    }
}

impl Target for BandFiles<'_> {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let path = band_file(&self.folder, band.row as usize / TILE_EDGE_PX);
        let png = png_of(canvas, band);
        let png = png.map_err(|error| WriteError::new(&path, io::Error::other(error)));
        let stored = StoredBand {
            row: band.row,
            rows: band.rows,
            channels: band.format.channels,
            png: png.map_err(RasterError::from)?,
        };
        Ok(write_part(&path, self.origin, &stored).map_err(RasterError::from)?)
    }
}

/// The file of a band, by its number from the first row of the canvas, in a folder.
fn band_file(folder: &Path, band: usize) -> PathBuf {
    folder.join(format!("band-{band}.state"))
}

/// Reads a band of the result of the run `origin`, by its number, from a folder.
///
/// # Errors
/// [`PartError`].
pub fn read_band(folder: &Path, band: usize, origin: &Origin) -> Result<Band, PartError> {
    let path = band_file(folder, band);
    let stored: StoredBand = read_part(&path, origin)?;
    let picture = image::load_from_memory_with_format(&stored.png, ImageFormat::Png);
    let samples = match picture {
        Ok(DynamicImage::ImageLumaA8(picture)) => picture.into_raw(),
        Ok(DynamicImage::ImageRgba8(picture)) => picture.into_raw(),
        other => {
            let what = match other {
                Ok(_) => "its pixels are of another kind".to_owned(),
                Err(error) => error.to_string(),
            };
            return Err(PartError::Damaged { path, what });
        }
    };
    let format = PixelFormat {
        channels: stored.channels,
        deep: false,
    };
    let samples = Samples::Eight(samples);
    Ok(Band::new(stored.row, stored.rows, format, samples))
}

/// The pixels of a band, 8 bits a sample, as a PNG.
fn png_of(canvas: &Canvas, band: &Band) -> Result<Vec<u8>, ImageError> {
    let colour = match band.format.channels {
        1 => ExtendedColorType::La8,
        _ => ExtendedColorType::Rgba8,
    };
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&band.samples.to_eight(), canvas.columns, band.rows, colour)?;
    Ok(png)
}
