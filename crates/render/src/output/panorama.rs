//! Panorama in memory.

use crate::compositing::band::{Band, Target};
use crate::error::RenderError;
use crate::layout::canvas::{Canvas, Layout};
use crate::sampling::pixel_format::{PixelFormat, luma};
use crate::sampling::sample::{Sample, Samples};
use image::DynamicImage;
use serde::{Deserialize, Serialize};
use tunnelstitch_core::frames::GreyImage;

/// A panorama in memory: samples with an alpha that is full where some frame sees the wall and 0 in
/// holes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Panorama {
    canvas: Canvas,
    format: PixelFormat,
    /// Row-major as [`Layout::ThetaRight`], alpha last.
    samples: Samples,
}

impl Panorama {
    /// Makes a panorama without any covered pixel.
    pub fn empty(canvas: Canvas, format: PixelFormat) -> Self {
        let count = canvas.pixels() * (format.channels + 1);
        Self {
            canvas,
            format,
            samples: if format.deep {
                Samples::Sixteen(vec![0; count])
            } else {
                Samples::Eight(vec![0; count])
            },
        }
    }

    /// Memory of its pixels, bytes.
    pub fn bytes(&self) -> u64 {
        self.samples.bytes() as u64
    }

    /// Canvas on the wall.
    pub fn canvas(&self) -> &Canvas {
        &self.canvas
    }

    /// Share of the pixels that some frame sees, 0–1.
    pub fn coverage(&self) -> f64 {
        let covered = self.values().filter(|(_, covered)| *covered).count();
        covered as f64 / self.canvas.pixels() as f64
    }

    /// Grey value (of 255, Rec. 709 luma of colour; 0 in holes) and whether it is covered, of each
    /// pixel.
    fn values(&self) -> Box<dyn Iterator<Item = (f32, bool)> + '_> {
        let step = self.format.channels + 1;
        match &self.samples {
            Samples::Eight(samples) => Box::new(samples.chunks_exact(step).map(value)),
            Samples::Sixteen(samples) => Box::new(samples.chunks_exact(step).map(value)),
        }
    }

    /// Grey values (of 255, Rec. 709 luma of colour; 0 in holes) and which pixels are covered,
    /// row-major as [`Layout::ThetaRight`].
    pub fn grey(&self) -> (GreyImage, Vec<bool>) {
        let (grey, covered) = self.values().unzip();
        let (width, height) = (self.canvas.columns as usize, self.canvas.rows as usize);
        (GreyImage::new(width, height, grey), covered)
    }

    /// Converts to a picture: grey or red-green-blue, with alpha.
    pub fn into_image(self, layout: Layout) -> DynamicImage {
        let size = [self.canvas.columns, self.canvas.rows];
        layout.turn(self.samples.into_image(size, self.format.channels))
    }
}

impl Target for Panorama {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let channels = self.format.channels + 1;
        let start = canvas.columns as usize * band.row as usize * channels;
        match (&mut self.samples, &band.samples) {
            (Samples::Eight(all), Samples::Eight(part)) => {
                all[start..start + part.len()].copy_from_slice(part);
            }
            (Samples::Sixteen(all), Samples::Sixteen(part)) => {
                all[start..start + part.len()].copy_from_slice(part);
            }
            _ => debug_assert!(false, "bands have the frames' format"),
        }
        Ok(())
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
