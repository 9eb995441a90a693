//! A row of a tile, added up from what frames show.

use crate::numerics::simd_dispatch::wide;
use crate::render::layout::placement::NO_FRAME;
use crate::render::sampling::point_batch::{RUN, Run};
use crate::render::sampling::sample::Sample;
use std::ops::Range;

/// Weighted sums of values, column by column.
pub struct Row {
    sums: [[f32; 4]; RUN],
    weights: [f32; RUN],
    /// The largest weight so far, and whose it is.
    largest: [f32; RUN],
    sources: [u32; RUN],
}

impl Default for Row {
    fn default() -> Self {
        Self {
            sums: [[0.0; 4]; RUN],
            weights: [0.0; RUN],
            largest: [0.0; RUN],
            sources: [NO_FRAME; RUN],
        }
    }
}

impl Row {
    /// Forgets some columns.
    pub fn clear(&mut self, columns: Range<usize>) {
        self.sums[columns.clone()].fill([0.0; 4]);
        self.weights[columns.clone()].fill(0.0);
        self.largest[columns.clone()].fill(0.0);
        self.sources[columns].fill(NO_FRAME);
    }

    /// The frame that weighs most in each column.
    pub fn sources(&self) -> &[u32; RUN] {
        &self.sources
    }

    /// The same, to be changed.
    pub fn sources_mut(&mut self) -> &mut [u32; RUN] {
        &mut self.sources
    }

    /// Whether one of some columns shows no frame yet.
    pub fn has_holes(&self, columns: Range<usize>) -> bool {
        self.sources[columns].contains(&NO_FRAME)
    }

    /// Adds to a column.
    #[inline(always)]
    pub fn add(&mut self, k: usize, value: &[f32; 4], w: f32) {
        let sum = &mut self.sums[k];
        *sum = std::array::from_fn(|c| sum[c] + w * value[c]);
        self.weights[k] += w;
    }

    /// Columns that show nothing but a frame.
    pub fn set(&mut self, run: &Run, frame: usize, columns: Range<usize>) {
        self.sums[columns.clone()].copy_from_slice(&run.values()[columns.clone()]);
        let seen = run.seen()[columns.clone()].iter();
        let columns = self.weights[columns.clone()]
            .iter_mut()
            .zip(&mut self.sources[columns]);
        for (seen, (weight, source)) in seen.zip(columns) {
            *weight = if *seen { 1.0 } else { 0.0 };
            *source = if *seen { frame as u32 } else { NO_FRAME };
        }
    }

    /// Columns from `from` that show a frame with some weight.
    pub fn mix(&mut self, run: &Run, frame: usize, from: usize, weights: &[f32]) {
        for (k, w) in weights.iter().enumerate() {
            let k = from + k;
            if run.seen()[k] && *w > 0.0 {
                self.add(k, &run.values()[k], *w);
                if *w > self.largest[k] {
                    self.largest[k] = *w;
                    self.sources[k] = frame as u32;
                }
            }
        }
    }

    /// Columns that show nothing yet.
    pub fn fill(&mut self, run: &Run, frame: usize, columns: Range<usize>) {
        for k in columns {
            if self.weights[k] == 0.0 && run.seen()[k] {
                self.sums[k] = run.values()[k];
                self.weights[k] = 1.0;
                self.sources[k] = frame as u32;
            }
        }
    }

    /// The pixels of some columns, `C` channels and alpha: means, with corrections (`L` lanes, of
    /// all columns) added.
    pub fn put<T: Sample, const C: usize, const L: usize>(
        &self,
        columns: Range<usize>,
        corrections: &[[f32; L]],
        pixels: &mut [T],
    ) {
        let (sums, weights) = (&self.sums[columns.clone()], &self.weights[columns.clone()]);
        let corrections = &corrections[columns];
        wide(
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
