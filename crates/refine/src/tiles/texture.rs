//! The texture of a tile: mean, median and robust mean of its observers.

use crate::tiles::grid::{Plane, SIDE, TILE, ZERO};
use crate::tiles::residual_weighting::{Loss, NoiseModel};
use crate::tiles::tile_arrays::{INTERIOR, Rows, ZERO_ROWS, squared_gradients, with_ring};
use crate::tiles::workspace::TileWorkspace;

/// Number of frames from which on the second smallest gradient sets the variance of a sample
/// instead of the smallest: only of four or more is it below the median one.
const MIN_FRAMES_FOR_SECOND_SMALLEST_GRADIENT: usize = 4;

// Everything here is inlined into its caller, which is compiled for the processor's widest vectors.
impl TileWorkspace {
    /// Mean of all observers, weighted by `q a²`; 0 where none has a value.
    #[inline(always)]
    pub fn mean(&self) -> Plane {
        let mut sum = ZERO;
        let mut total = [1e-12f32; ZERO.len()];
        for frame in &self.frames {
            let q = frame.pixels * frame.gain * frame.gain;
            for k in 0..ZERO.len() {
                total[k] += q * frame.valid[k];
                sum[k] += q * frame.values[k];
            }
        }
        for (sum, total) in sum.iter_mut().zip(&total) {
            *sum /= total;
        }
        sum
    }

    /// Median of all observers; an observer without a value counts as the mean, and a sample
    /// without any value is 0.
    #[inline(always)]
    pub fn median(&mut self) -> Plane {
        let mean = self.mean();
        let n = self.frames.len();
        self.sorted.clear();
        for frame in &self.frames {
            let mut values = frame.values;
            if self.has_gaps {
                for k in 0..ZERO.len() {
                    values[k] += (1.0 - frame.valid[k]) * (mean[k] - values[k]);
                }
            }
            self.sorted.push(values);
        }
        // Odd–even transposition sort: the same steps for all samples, in whole vectors.
        for round in 0..n {
            for pair in self.sorted[round % 2..].chunks_exact_mut(2) {
                let [low, high] = pair else { continue };
                for k in 0..ZERO.len() {
                    let (a, b) = (low[k], high[k]);
                    (low[k], high[k]) = (a.min(b), a.max(b));
                }
            }
        }
        let mut median = self.sorted[(n - 1) / 2];
        for (median, upper) in median.iter_mut().zip(&self.sorted[n / 2]) {
            *median = 0.5 * (*median + upper);
        }
        median
    }

    /// One step of iteratively reweighted least squares: sets every weight ω by the residual from
    /// `reference` and returns the mean with the weights `q a² ω`.
    ///
    /// The weighted residuals from that mean sum to zero at every sample, exactly. Otherwise the
    /// gradient would have a part along the gauge, which only the weak prior constrains.
    #[inline(always)]
    pub fn reweight(&mut self, reference: &Plane, precision: &Plane) -> Plane {
        let mut sum = ZERO;
        let mut total = [1e-12f32; ZERO.len()];
        for frame in &mut self.frames {
            let q = frame.pixels * frame.gain * frame.gain;
            let (mut difference, mut w) = (ZERO, ZERO);
            for k in 0..ZERO.len() {
                difference[k] = frame.values[k] - reference[k];
                let e = frame.gain * difference[k];
                w[k] = frame.valid[k] * Loss::weight(e * e, precision[k]);
            }
            for k in 0..ZERO.len() {
                total[k] += q * w[k];
                sum[k] += q * w[k] * difference[k];
            }
            frame.weights = w;
        }
        let mut texture = *reference;
        for k in 0..ZERO.len() {
            texture[k] += sum[k] / total[k];
        }
        texture
    }

    /// 1 at the samples where the texture has a slope, as some observer has a value there and at
    /// all four neighbours; else 0.
    #[inline(always)]
    pub fn covered(&self) -> Rows {
        if !self.has_gaps {
            return INTERIOR;
        }
        let mut valid = ZERO;
        for frame in &self.frames {
            for (valid, own) in valid.iter_mut().zip(&frame.valid) {
                *valid = valid.max(*own);
            }
        }
        std::array::from_fn(|k| {
            let c = k + SIDE;
            INTERIOR[k] * valid[c] * valid[c - 1] * valid[c + 1] * valid[c - SIDE] * valid[c + SIDE]
        })
    }

    /// Squared gradient `g²` of the texture, (grey levels per sample)²: the smallest over the
    /// frames, or the second smallest of many, each in its frame's own grey levels.
    ///
    /// A gradient that only one frame shows is a glint or the edge of an object in front of the
    /// wall, and must not raise the variance. (In the wall's grey levels a common factor of all
    /// gains would change the noise model, and with it the cost.)
    #[inline(always)]
    fn squared_gradient(&self) -> Plane {
        let (mut smallest, mut second) =
            ([f32::INFINITY; TILE * SIDE], [f32::INFINITY; TILE * SIDE]);
        for frame in &self.frames {
            let square_gain = frame.gain * frame.gain;
            let squares = squared_gradients(&frame.values);
            for k in 0..ZERO_ROWS.len() {
                let square = square_gain * squares[k];
                second[k] = second[k].min(square.max(smallest[k]));
                smallest[k] = smallest[k].min(square);
            }
        }
        with_ring(
            if self.frames.len() < MIN_FRAMES_FOR_SECOND_SMALLEST_GRADIENT {
                &smallest
            } else {
                &second
            },
        )
    }

    /// `1/v` at every wall sample.
    #[inline(always)]
    pub fn precision(&self, noise: &NoiseModel) -> Plane {
        self.squared_gradient().map(
            #[inline(always)]
            |g2| noise.precision(g2),
        )
    }
}
