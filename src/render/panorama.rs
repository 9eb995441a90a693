//! The finished panorama.

use super::picture::{PixelFormat, luma};
use super::sample::{Sample, Samples};
use super::{Canvas, Drawn, Layout, Tile};
use crate::frames::GreyImage;
use image::{DynamicImage, ImageBuffer};

/// A panorama in memory: samples with an alpha that is full where some frame sees the wall and 0 in holes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    canvas: Canvas,
    format: PixelFormat,
    /// Row-major as [`Layout::ThetaRight`], alpha last.
    samples: Samples,
}

impl Panorama {
    /// A panorama that is one hole.
    pub(super) fn empty(canvas: Canvas, format: PixelFormat) -> Self {
        let count = canvas.pixels() * (format.channels + 1);
        Self {
            canvas,
            format,
            samples: match format.deep {
                true => Samples::Sixteen(vec![0; count]),
                false => Samples::Eight(vec![0; count]),
            },
        }
    }

    /// Puts a tile into its place.
    pub(super) fn put(&mut self, tile: &Tile, drawn: &Drawn) {
        let channels = self.format.channels + 1;
        match (&mut self.samples, &drawn.samples) {
            (Samples::Eight(all), Samples::Eight(part)) => {
                copy(all, self.canvas.columns, part, tile, channels);
            }
            (Samples::Sixteen(all), Samples::Sixteen(part)) => {
                copy(all, self.canvas.columns, part, tile, channels);
            }
            _ => debug_assert!(false, "tiles have the frames' format"),
        }
    }

    /// Its place on the wall.
    pub fn canvas(&self) -> &Canvas {
        &self.canvas
    }

    /// Share of the pixels that some frame sees, 0–1.
    pub fn coverage(&self) -> f64 {
        let covered = self.values().filter(|(_, covered)| *covered).count();
        covered as f64 / self.canvas.pixels() as f64
    }

    /// Grey value (of 255, Rec. 709 luma of colour; 0 in holes) and whether it is covered, of each pixel.
    fn values(&self) -> Box<dyn Iterator<Item = (f32, bool)> + '_> {
        let step = self.format.channels + 1;
        match &self.samples {
            Samples::Eight(samples) => Box::new(samples.chunks_exact(step).map(value)),
            Samples::Sixteen(samples) => Box::new(samples.chunks_exact(step).map(value)),
        }
    }

    /// Grey values (of 255, Rec. 709 luma of colour; 0 in holes) and which pixels are covered, row-major as
    /// [`Layout::ThetaRight`].
    pub fn grey(&self) -> (GreyImage, Vec<bool>) {
        let (grey, covered) = self.values().unzip();
        let (width, height) = (self.canvas.columns as usize, self.canvas.rows as usize);
        (GreyImage::new(width, height, grey), covered)
    }

    /// The picture to be written: grey or red-green-blue, with alpha.
    pub fn into_image(self, layout: Layout) -> DynamicImage {
        let (width, height) = (self.canvas.columns, self.canvas.rows);
        // The length was checked when the panorama was made, so the pictures exist.
        let image = match (self.samples, self.format.channels) {
            (Samples::Eight(samples), 1) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageLumaA8)
            }
            (Samples::Eight(samples), _) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageRgba8)
            }
            (Samples::Sixteen(samples), 1) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageLumaA16)
            }
            (Samples::Sixteen(samples), _) => {
                ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageRgba16)
            }
        };
        layout.turn(image.unwrap_or_default())
    }
}

fn copy<T: Sample>(all: &mut [T], columns: u32, part: &[T], tile: &Tile, channels: usize) {
    let stride = columns as usize * channels;
    let (start, length) = (
        tile.column as usize * channels,
        tile.columns as usize * channels,
    );
    let rows = all[tile.row as usize * stride..].chunks_exact_mut(stride);
    for (row, source) in rows.zip(part.chunks_exact(length)) {
        row[start..start + length].copy_from_slice(source);
    }
}

fn value<T: Sample>(pixel: &[T]) -> (f32, bool) {
    let scale = 255.0 / T::WHITE;
    match *pixel {
        [red, green, blue, alpha] => {
            let value = luma([red, green, blue].map(Sample::value));
            (scale * value, alpha.value() > 0.0)
        }
        [grey, alpha] => (scale * grey.value(), alpha.value() > 0.0),
        _ => (0.0, false),
    }
}
