//! The panorama as it is drawn: band by band, and who takes it.

use super::draw::Drawn;
use super::sample::{Sample, Samples};
use super::{Canvas, PixelFormat, RenderError, Tile};

/// A stretch of the canvas, all around and some rows along.
#[derive(Clone, Debug)]
pub struct Band {
    /// First row.
    pub row: u32,
    /// Number of rows.
    pub rows: u32,
    /// What the pixels are.
    pub format: PixelFormat,
    /// The pixels, row-major over all columns, alpha last: full where some frame sees the wall, 0 in holes.
    pub samples: Samples,
    /// The frame that each pixel shows most of; [`super::NO_FRAME`] in holes and where frames are mixed everywhere.
    pub sources: Vec<u32>,
}

/// Takes bands, from the first row of the canvas to the last.
pub trait Target {
    /// Takes the next band.
    ///
    /// # Errors
    /// What the system says.
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError>;
}

impl Band {
    /// A band without anything in it.
    pub(super) fn empty(canvas: &Canvas, row: u32, rows: u32, format: PixelFormat) -> Self {
        let pixels = canvas.columns as usize * rows as usize;
        let count = pixels * (format.channels + 1);
        Self {
            row,
            rows,
            format,
            samples: match format.deep {
                true => Samples::Sixteen(vec![0; count]),
                false => Samples::Eight(vec![0; count]),
            },
            sources: vec![super::NO_FRAME; pixels],
        }
    }

    /// Puts a tile into its place.
    pub(super) fn put(&mut self, canvas: &Canvas, tile: &Tile, drawn: &Drawn) {
        let place = Place {
            row: (tile.row - self.row) as usize,
            column: tile.column as usize,
            columns: tile.columns as usize,
            all: canvas.columns as usize,
        };
        let channels = self.format.channels + 1;
        match (&mut self.samples, &drawn.samples) {
            (Samples::Eight(all), Samples::Eight(part)) => place.copy(all, part, channels),
            (Samples::Sixteen(all), Samples::Sixteen(part)) => place.copy(all, part, channels),
            _ => debug_assert!(false, "tiles have the frames' format"),
        }
        place.copy(&mut self.sources, &drawn.sources, 1);
    }

    /// Whether each pixel is covered.
    pub fn covered(&self) -> Vec<bool> {
        let step = self.format.channels + 1;
        match &self.samples {
            Samples::Eight(samples) => alpha(samples, step),
            Samples::Sixteen(samples) => alpha(samples, step),
        }
    }
}

fn alpha<T: Sample>(samples: &[T], step: usize) -> Vec<bool> {
    let pixels = samples.chunks_exact(step);
    pixels.map(|pixel| pixel[step - 1] != T::default()).collect()
}

/// Where a tile lies in a band, pixels.
struct Place {
    row: usize,
    column: usize,
    columns: usize,
    /// Columns of the band.
    all: usize,
}

impl Place {
    /// Copies a tile's pixels of `step` numbers into those of the band.
    fn copy<T: Copy>(&self, band: &mut [T], tile: &[T], step: usize) {
        let rows = band.chunks_exact_mut(self.all * step).skip(self.row);
        for (to, from) in rows.zip(tile.chunks_exact(self.columns * step)) {
            to[self.column * step..][..from.len()].copy_from_slice(from);
        }
    }
}
