//! Bands of the panorama, and the trait of those that receive them.

use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use crate::layout::placement::NO_FRAME;
use crate::layout::tiles::{BAND_ROWS, Tile};
use crate::sampling::pixel_format::PixelFormat;
use crate::sampling::sample::{Sample, Samples};
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_super_resolve::Region;

/// A stretch of the canvas, all around and some rows along.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Band {
    /// First row.
    pub row: u32,
    /// Number of rows.
    pub rows: u32,
    /// Channels and depth.
    pub format: PixelFormat,
    /// Pixels, row-major over all columns, alpha last: full where some frame sees the wall, 0 in
    /// holes.
    pub samples: Samples,
    /// Frame that each pixel shows most of; [`NO_FRAME`] in holes and where frames are mixed
    /// everywhere. Empty unless some target needs it ([`Target::wants_sources`]).
    pub sources: Vec<u32>,
}

/// Receives bands, from the first row of the canvas to the last.
pub trait Target: Send {
    /// Receives the next band.
    ///
    /// # Errors
    /// An error of the target, such as one of the file system.
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError>;

    /// True if it needs [`Band::sources`].
    fn wants_sources(&self) -> bool {
        false
    }
}

impl Band {
    /// A band of these pixels, without sources.
    pub fn new(row: u32, rows: u32, format: PixelFormat, samples: Samples) -> Self {
        Self {
            row,
            rows,
            format,
            samples,
            sources: Vec::new(),
        }
    }

    /// Makes a band without rows, with sources or without.
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

    /// Starts the band of other rows, whose tiles are all still to be drawn.
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

    /// Splits it into the pixels of its tiles; `tiles`: row by row of tiles.
    pub(crate) fn tile_pixels(&mut self, canvas: &Canvas, tiles: &[Tile]) -> Vec<TilePixels<'_>> {
        let columns = canvas.columns as usize;
        let step = self.format.channels + 1;
        let sources = split_into_tiles(&mut self.sources, columns, 1, tiles);
        let pixels: Vec<PixelRows> = match &mut self.samples {
            Samples::Eight(samples) => {
                let pixels = split_into_tiles(samples, columns, step, tiles).into_iter();
                pixels.map(PixelRows::Eight).collect()
            }
            Samples::Sixteen(samples) => {
                let pixels = split_into_tiles(samples, columns, step, tiles).into_iter();
                pixels.map(PixelRows::Sixteen).collect()
            }
        };
        let places = pixels.into_iter().zip(sources);
        places
            .map(|(pixels, sources)| TilePixels { pixels, sources })
            .collect()
    }

    /// Reads one channel of a region, grey levels of 255; NaN in holes. Rows beyond the band repeat
    /// its first or last one.
    pub(crate) fn read_region(&self, canvas: &Canvas, region: &Region, channel: usize) -> Vec<f32> {
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
                    Samples::Eight(samples) => read_grey(&samples[pixel..][..step], channel),
                    Samples::Sixteen(samples) => read_grey(&samples[pixel..][..step], channel),
                });
            }
        }
        values
    }

    /// Writes one channel of a tile, grey levels of 255; NaN leaves a pixel unchanged.
    pub(crate) fn write_channel(
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
                    write_grey(&mut samples[pixel * step..][..step], channel, *value)
                }
                Samples::Sixteen(samples) => {
                    write_grey(&mut samples[pixel * step..][..step], channel, *value);
                }
            }
        }
    }

    /// True for each pixel that some frame sees.
    pub fn covered(&self) -> Vec<bool> {
        match (&self.samples, self.format.channels) {
            (Samples::Eight(samples), 1) => covered_pixels::<_, 2>(samples),
            (Samples::Eight(samples), _) => covered_pixels::<_, 4>(samples),
            (Samples::Sixteen(samples), 1) => covered_pixels::<_, 2>(samples),
            (Samples::Sixteen(samples), _) => covered_pixels::<_, 4>(samples),
        }
    }
}

fn read_grey<T: Sample>(pixel: &[T], channel: usize) -> f32 {
    let covered = pixel[pixel.len() - 1] != T::default();
    if covered {
        pixel[channel].value() * (255.0 / T::WHITE)
    } else {
        f32::NAN
    }
}

/// Writes a covered pixel; others stay, as a frame's edge runs through some that it does not quite
/// show.
fn write_grey<T: Sample>(pixel: &mut [T], channel: usize, grey: f32) {
    if pixel[pixel.len() - 1] != T::default() {
        pixel[channel] = T::nearest(grey * (T::WHITE / 255.0));
    }
}

/// True for each pixel of `N` samples that has an alpha.
fn covered_pixels<T: Sample, const N: usize>(samples: &[T]) -> Vec<bool> {
    let pixels = samples.as_chunks::<N>().0;
    dispatch_simd(
        #[inline(always)]
        || {
            let alpha = pixels.iter().map(|pixel| pixel[N - 1] != T::default());
            alpha.collect()
        },
    )
}

/// Pixels of a tile within its band.
pub struct TilePixels<'a> {
    /// Pixels, alpha last: full where some frame sees the wall, 0 in holes.
    pub(crate) pixels: PixelRows<'a>,
    /// Frame that each pixel shows most of, [`NO_FRAME`] in holes and where frames are mixed
    /// everywhere; row by row, or no rows if no target needs it.
    pub(crate) sources: Vec<&'a mut [u32]>,
}

/// Rows of samples.
pub(crate) enum PixelRows<'a> {
    /// 8 bits.
    Eight(Vec<&'a mut [u8]>),
    /// 16 bits.
    Sixteen(Vec<&'a mut [u16]>),
}

/// Splits rows of `columns` pixels of `step` numbers into those of tiles.
fn split_into_tiles<'a, T>(
    all: &'a mut [T],
    columns: usize,
    step: usize,
    tiles: &[Tile],
) -> Vec<Vec<&'a mut [T]>> {
    let mut split_into_tiles: Vec<Vec<&mut [T]>> = tiles
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
                split_into_tiles[first + k].push(own);
            }
        }
        first += across.len();
    }
    split_into_tiles
}
