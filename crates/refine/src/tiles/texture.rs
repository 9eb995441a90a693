//! The texture of a tile: mean, median and robust mean of its observers.

use crate::thresholds::tile::REWEIGHTING_ITERATIONS;
use crate::tiles::grid::{LANES, Plane, SIDE, ZERO};
use crate::tiles::lanes::{Lanes, load, store};
use crate::tiles::residual_weighting::{Loss, NoiseModel};
use crate::tiles::tile_arrays::{INTERIOR, Rows, ZERO_ROWS, squared_gradients_at, with_ring};
use crate::tiles::workspace::{FrameValues, TileWorkspace};

/// Number of frames from which on the second smallest gradient sets the variance of a sample
/// instead of the smallest: only of four or more is it below the median one.
const MIN_FRAMES_FOR_SECOND_SMALLEST_GRADIENT: usize = 4;

// Everything here is inlined into its caller, which is compiled for the processor's widest vectors.
impl TileWorkspace {
    /// Mean of all observers, weighted by `q a²`; 0 where none has a value.
    #[inline(always)]
    pub fn mean(&self) -> Plane {
        let mut mean = ZERO;
        for k in (0..ZERO.len()).step_by(LANES) {
            store(&mut mean, k, mean_at(&self.frames, k));
        }
        mean
    }

    /// Median of all observers; an observer without a value counts as the mean, and a sample
    /// without any value is 0.
    #[inline(always)]
    pub fn median(&mut self) -> Plane {
        let mean = self.mean();
        let n = self.frames.len();
        self.sorted.clear();
        self.sorted.reserve(n);
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

    /// Robust mean S of all observers and their weights ω, from another mean or the median.
    #[inline(always)]
    pub fn robust_mean(&mut self, mut texture: Plane, precision: &Plane) -> Plane {
        for k in (0..ZERO.len()).step_by(LANES) {
            let start = load(&texture, k);
            let robust = robust_mean_at(&mut self.frames, k, start, precision);
            store(&mut texture, k, robust);
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
        let is_second = self.frames.len() >= MIN_FRAMES_FOR_SECOND_SMALLEST_GRADIENT;
        let mut squares = ZERO_ROWS;
        for k in (0..ZERO_ROWS.len()).step_by(LANES) {
            let (mut smallest, mut second) = ([f32::INFINITY; LANES], [f32::INFINITY; LANES]);
            for frame in &self.frames {
                let square = squared_gradients_at(&frame.values, k);
                let square_gain = frame.gain * frame.gain;
                for l in 0..LANES {
                    let square = square_gain * square[l];
                    second[l] = second[l].min(square.max(smallest[l]));
                    smallest[l] = smallest[l].min(square);
                }
            }
            store(&mut squares, k, if is_second { second } else { smallest });
        }
        with_ring(&squares)
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

/// Mean of all observers at the samples from `k` on.
#[inline(always)]
fn mean_at(frames: &[FrameValues], k: usize) -> Lanes {
    let (mut sum, mut total) = ([0.0; LANES], [1e-12; LANES]);
    for frame in frames {
        let q = frame.pixels * frame.gain * frame.gain;
        let (z, valid) = (load(&frame.values, k), load(&frame.valid, k));
        for l in 0..LANES {
            total[l] += q * valid[l];
            sum[l] += q * z[l];
        }
    }
    for l in 0..LANES {
        sum[l] /= total[l];
    }
    sum
}

/// Iteratively reweighted least squares from `texture` at the samples from `k` on: each step sets
/// every weight ω by the residual and goes to the mean with the weights `q a² ω`.
///
/// The weighted residuals from that mean sum to zero at every sample, exactly. Otherwise the
/// gradient would have a part along the gauge, which only the weak prior constrains.
#[inline(always)]
fn robust_mean_at(
    frames: &mut [FrameValues],
    k: usize,
    mut texture: Lanes,
    precision: &Plane,
) -> Lanes {
    let p = load(precision, k);
    for _ in 0..REWEIGHTING_ITERATIONS {
        let (mut sum, mut total) = ([0.0; LANES], [1e-12; LANES]);
        for frame in &mut *frames {
            let q = frame.pixels * frame.gain * frame.gain;
            let (z, valid) = (load(&frame.values, k), load(&frame.valid, k));
            let mut w = [0.0; LANES];
            for l in 0..LANES {
                let difference = z[l] - texture[l];
                let e = frame.gain * difference;
                w[l] = valid[l] * Loss::weight(e * e, p[l]);
                total[l] += q * w[l];
                sum[l] += q * w[l] * difference;
            }
            store(&mut frame.weights, k, w);
        }
        for l in 0..LANES {
            texture[l] += sum[l] / total[l];
        }
    }
    texture
}
