//! Weighted sums along a row of a tile.

use crate::layout::placement::NO_FRAME;
use crate::layout::tiles::TILE_COLUMNS;
use crate::sampling::point_batch::PointBatch;
use crate::sampling::sample::Sample;
use std::ops::Range;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// Accumulator of weighted values, column by column.
pub struct RowAccumulator {
    sums: [[f32; 4]; TILE_COLUMNS],
    weights: [f32; TILE_COLUMNS],
    /// Largest weight so far, and the frame that has it.
    largest: [f32; TILE_COLUMNS],
    sources: [u32; TILE_COLUMNS],
}

impl Default for RowAccumulator {
    fn default() -> Self {
        Self {
            sums: [[0.0; 4]; TILE_COLUMNS],
            weights: [0.0; TILE_COLUMNS],
            largest: [0.0; TILE_COLUMNS],
            sources: [NO_FRAME; TILE_COLUMNS],
        }
    }
}

impl RowAccumulator {
    /// Clears some columns.
    pub fn clear(&mut self, columns: Range<usize>) {
        self.sums[columns.clone()].fill([0.0; 4]);
        self.weights[columns.clone()].fill(0.0);
        self.largest[columns.clone()].fill(0.0);
        self.sources[columns].fill(NO_FRAME);
    }

    /// Frame of the largest weight in each column.
    pub fn sources(&self) -> &[u32; TILE_COLUMNS] {
        &self.sources
    }

    /// Frame of the largest weight in each column, to be changed.
    pub fn sources_mut(&mut self) -> &mut [u32; TILE_COLUMNS] {
        &mut self.sources
    }

    /// True if one of some columns shows no frame yet.
    pub fn has_holes(&self, columns: Range<usize>) -> bool {
        self.sources[columns].contains(&NO_FRAME)
    }

    /// Adds a weighted value to a column.
    #[inline(always)]
    pub fn add(&mut self, k: usize, value: &[f32; 4], w: f32) {
        let sum = &mut self.sums[k];
        *sum = std::array::from_fn(|c| sum[c] + w * value[c]);
        self.weights[k] += w;
    }

    /// Sets columns that show one frame alone.
    pub fn set(&mut self, batch: &PointBatch, frame: usize, columns: Range<usize>) {
        self.sums[columns.clone()].copy_from_slice(&batch.values()[columns.clone()]);
        let seen = batch.seen()[columns.clone()].iter();
        let columns = self.weights[columns.clone()]
            .iter_mut()
            .zip(&mut self.sources[columns]);
        for (seen, (weight, source)) in seen.zip(columns) {
            *weight = if *seen { 1.0 } else { 0.0 };
            *source = if *seen { frame as u32 } else { NO_FRAME };
        }
    }

    /// Adds a frame with its weights to columns from `from` on.
    pub fn mix(&mut self, batch: &PointBatch, frame: usize, from: usize, weights: &[f32]) {
        for (k, w) in weights.iter().enumerate() {
            let k = from + k;
            if batch.seen()[k] && *w > 0.0 {
                self.add(k, &batch.values()[k], *w);
                if *w > self.largest[k] {
                    self.largest[k] = *w;
                    self.sources[k] = frame as u32;
                }
            }
        }
    }

    /// Sets those columns that show nothing yet to a frame's values.
    pub fn fill(&mut self, batch: &PointBatch, frame: usize, columns: Range<usize>) {
        for k in columns {
            if self.weights[k] == 0.0 && batch.seen()[k] {
                self.sums[k] = batch.values()[k];
                self.weights[k] = 1.0;
                self.sources[k] = frame as u32;
            }
        }
    }

    /// Writes the pixels of some columns, `C` channels and alpha: weighted means plus corrections
    /// (`L` lanes, of all columns).
    pub fn put<T: Sample, const C: usize, const L: usize>(
        &self,
        columns: Range<usize>,
        corrections: &[[f32; L]],
        pixels: &mut [T],
    ) {
        let (sums, weights) = (&self.sums[columns.clone()], &self.weights[columns.clone()]);
        let corrections = &corrections[columns];
        dispatch_simd(
            #[inline(always)]
            || {
                let means = sums.iter().zip(weights).zip(corrections);
                for (pixel, ((sum, w), more)) in pixels.chunks_exact_mut(C + 1).zip(means) {
                    let (w, inverse) = (*w, 1.0 / *w);
                    for c in 0..C {
                        let value = sum[c] * inverse + more[c];
                        pixel[c] = T::nearest(if w > 0.0 { value } else { 0.0 });
                    }
                    pixel[C] = T::nearest(if w > 0.0 { T::WHITE } else { 0.0 });
                }
            },
        );
    }
}
