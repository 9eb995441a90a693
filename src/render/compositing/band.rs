//! The panorama as it is drawn: band by band, and who takes it.

use crate::numerics::simd_dispatch::wide;
use crate::render::error::RenderError;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::placement::NO_FRAME;
use crate::render::layout::tiles::{BAND_ROWS, Tile};
use crate::render::sampling::pixel_format::PixelFormat;
use crate::render::sampling::sample::{Sample, Samples};
use crate::super_resolve::Region;

/// A stretch of the canvas, all around and some rows along.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Band {
    /// First row.
    pub row: u32,
    /// Number of rows.
    pub rows: u32,
    /// What the pixels are.
    pub format: PixelFormat,
    /// The pixels, row-major over all columns, alpha last: full where some frame sees the wall, 0
    /// in holes.
    pub samples: Samples,
    /// The frame that each pixel shows most of; [`NO_FRAME`] in holes and where frames are mixed
    /// everywhere. Empty unless some target asks for it ([`Target::wants_sources`]).
    pub sources: Vec<u32>,
}

/// Takes bands, from the first row of the canvas to the last.
pub trait Target: Send {
    /// Takes the next band.
    ///
    /// # Errors
    /// What the system says.
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError>;

    /// Whether it needs [`Band::sources`].
    fn wants_sources(&self) -> bool {
        false
    }
}

impl Band {
    /// A band without rows, with sources or without.
    pub(crate) fn empty(canvas: &Canvas, format: PixelFormat, sources: bool) -> Self {
        let most = canvas.columns as usize * BAND_ROWS.min(canvas.rows) as usize;
        let count = most * (format.channels + 1);
        Self {
            row: 0,
            rows: 0,
            format,
            samples: if format.deep {
                Samples::Sixteen(Vec::with_capacity(count))
            } else {
                Samples::Eight(Vec::with_capacity(count))
            },
            sources: Vec::with_capacity(if sources { most } else { 0 }),
        }
    }

    /// Makes it the band of other rows, in which all tiles are still to be drawn.
    pub(crate) fn begin(&mut self, canvas: &Canvas, row: u32, rows: u32) {
        (self.row, self.rows) = (row, rows);
        let pixels = canvas.columns as usize * rows as usize;
        let count = pixels * (self.format.channels + 1);
        match &mut self.samples {
            Samples::Eight(samples) => samples.resize(count, 0),
            Samples::Sixteen(samples) => samples.resize(count, 0),
        }
        if self.sources.capacity() > 0 {
            self.sources.resize(pixels, NO_FRAME);
        }
    }

    /// The places of all its tiles, `tiles` row by row of tiles.
    pub(crate) fn places(&mut self, canvas: &Canvas, tiles: &[Tile]) -> Vec<Place<'_>> {
        let columns = canvas.columns as usize;
        let step = self.format.channels + 1;
        let sources = cut(&mut self.sources, columns, 1, tiles);
        let pixels: Vec<Rows> = match &mut self.samples {
            Samples::Eight(samples) => {
                let pixels = cut(samples, columns, step, tiles).into_iter();
                pixels.map(Rows::Eight).collect()
            }
            Samples::Sixteen(samples) => {
                let pixels = cut(samples, columns, step, tiles).into_iter();
                pixels.map(Rows::Sixteen).collect()
            }
        };
        let places = pixels.into_iter().zip(sources);
        places
            .map(|(pixels, sources)| Place { pixels, sources })
            .collect()
    }

    /// One channel of a region, grey levels of 255; NaN in holes. Rows beyond the band's are those
    /// next to them.
    pub(crate) fn region(&self, canvas: &Canvas, region: &Region, channel: usize) -> Vec<f32> {
        let step = self.format.channels + 1;
        let columns = i64::from(canvas.columns);
        let last = i64::from(self.row + self.rows) - 1;
        let mut values = Vec::with_capacity(region.pixels());
        for row in 0..region.rows as i64 {
            let row = (region.row + row).clamp(i64::from(self.row), last) - i64::from(self.row);
            for column in 0..region.columns as i64 {
                let column = (region.column + column).rem_euclid(columns);
                let pixel = (row * columns + column) as usize * step;
                values.push(match &self.samples {
                    Samples::Eight(samples) => grey(&samples[pixel..][..step], channel),
                    Samples::Sixteen(samples) => grey(&samples[pixel..][..step], channel),
                });
            }
        }
        values
    }

    /// Puts one channel of a tile into its place, grey levels of 255; NaN changes nothing.
    pub(crate) fn put_channel(
        &mut self,
        canvas: &Canvas,
        tile: &Tile,
        channel: usize,
        values: &[f32],
    ) {
        let step = self.format.channels + 1;
        for (k, value) in values.iter().enumerate() {
            if value.is_nan() {
                continue;
            }
            let (row, column) = (k / tile.columns as usize, k % tile.columns as usize);
            let row = (tile.row - self.row) as usize + row;
            let pixel = row * canvas.columns as usize + tile.column as usize + column;
            match &mut self.samples {
                Samples::Eight(samples) => {
                    put(&mut samples[pixel * step..][..step], channel, *value)
                }
                Samples::Sixteen(samples) => {
                    put(&mut samples[pixel * step..][..step], channel, *value);
                }
            }
        }
    }

    /// Whether each pixel is covered.
    pub fn covered(&self) -> Vec<bool> {
        match (&self.samples, self.format.channels) {
            (Samples::Eight(samples), 1) => alpha::<_, 2>(samples),
            (Samples::Eight(samples), _) => alpha::<_, 4>(samples),
            (Samples::Sixteen(samples), 1) => alpha::<_, 2>(samples),
            (Samples::Sixteen(samples), _) => alpha::<_, 4>(samples),
        }
    }
}

fn grey<T: Sample>(pixel: &[T], channel: usize) -> f32 {
    let covered = pixel[pixel.len() - 1] != T::default();
    if covered {
        pixel[channel].value() * (255.0 / T::WHITE)
    } else {
        f32::NAN
    }
}

/// Covered pixels only: a frame's edge runs through some that it does not quite show.
fn put<T: Sample>(pixel: &mut [T], channel: usize, grey: f32) {
    if pixel[pixel.len() - 1] != T::default() {
        pixel[channel] = T::nearest(grey * (T::WHITE / 255.0));
    }
}

/// Which pixels of `N` samples have an alpha.
fn alpha<T: Sample, const N: usize>(samples: &[T]) -> Vec<bool> {
    let pixels = samples.as_chunks::<N>().0;
    wide(
        #[inline(always)]
        || {
            let alpha = pixels.iter().map(|pixel| pixel[N - 1] != T::default());
            alpha.collect()
        },
    )
}

/// Where a tile is drawn.
pub struct Place<'a> {
    /// Its pixels, alpha last: full where some frame sees the wall, 0 in holes.
    pub(crate) pixels: Rows<'a>,
    /// The frame that each pixel shows most of, [`NO_FRAME`] in holes and where frames are mixed
    /// all over; row by row, or no rows if nobody asks.
    pub(crate) sources: Vec<&'a mut [u32]>,
}

/// Rows of samples.
pub(crate) enum Rows<'a> {
    /// 8 bits.
    Eight(Vec<&'a mut [u8]>),
    /// 16 bits.
    Sixteen(Vec<&'a mut [u16]>),
}

/// Cuts rows of `columns` pixels of `step` numbers into those of tiles.
fn cut<'a, T>(
    all: &'a mut [T],
    columns: usize,
    step: usize,
    tiles: &[Tile],
) -> Vec<Vec<&'a mut [T]>> {
    let mut cut: Vec<Vec<&mut [T]>> = tiles
        .iter()
        .map(|tile| Vec::with_capacity(tile.rows as usize))
        .collect();
    let mut rows = all.chunks_exact_mut(columns * step);
    // Rows of tiles: from one that begins at the first column to the next.
    let mut first = 0;
    for across in tiles.chunk_by(|a, b| a.row == b.row) {
        for _ in 0..across.first().map_or(0, |tile| tile.rows) {
            let Some(mut rest) = rows.next() else { break };
            for (k, tile) in across.iter().enumerate() {
                let own;
                (own, rest) = rest.split_at_mut(tile.columns as usize * step);
                cut[first + k].push(own);
            }
        }
        first += across.len();
    }
    cut
}
