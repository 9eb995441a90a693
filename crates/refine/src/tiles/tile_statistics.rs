//! Statistics of a tile beside its moments: misfits, mean values, residuals and slopes.

use crate::tiles::denoising::{TextureSpectrum, TileFrame};
use crate::tiles::grid::{SIDE, TilePoints};
use crate::tiles::residual_weighting::{Loss, NoiseHistogram, NoiseModel};
use crate::tiles::tile_arrays::{INTERIOR, SAMPLES, ZERO_ROWS, squared_gradients, sum};
use crate::tiles::workspace::{FrameValues, Misfit, TileObservation, TileWorkspace};

// Everything here is inlined into its caller, which is compiled for the processor's widest vectors.
impl TileWorkspace {
    /// Fills [`TileWorkspace::misfits`]: the residuals of a tile's observers from the robust mean
    /// that starts at their median.
    #[inline(always)]
    pub fn compute_misfits<'a>(
        &mut self,
        points: &TilePoints,
        observations: impl Iterator<Item = TileObservation<'a>>,
        noise: &NoiseModel,
    ) {
        self.sample(points, observations);
        let precision = self.precision(noise);
        let median = self.median();
        let texture = self.robust_mean(median, &precision);
        self.misfits.clear();
        for frame in &self.frames {
            let (mut loss, mut variance) = (ZERO_ROWS, ZERO_ROWS);
            for k in 0..ZERO_ROWS.len() {
                let c = k + SIDE;
                let e = frame.gain * (frame.values[c] - texture[c]);
                variance[k] = INTERIOR[k] * frame.valid[c] / precision[c];
                loss[k] = variance[k] * Loss::relative_loss(e * e, precision[c]);
            }
            let total = sum(&variance);
            self.misfits.push(Misfit {
                loss: sum(&loss) / total.max(1e-9),
                mean_variance: total / SAMPLES as f32,
            });
        }
    }

    /// Mean value z of each observer over the tile; NaN if it lacks a value.
    #[inline(always)]
    pub fn mean_values<'a>(
        &mut self,
        points: &TilePoints,
        observations: impl Iterator<Item = TileObservation<'a>>,
    ) -> Vec<f64> {
        self.sample(points, observations);
        let means = self.frames.iter().map(|frame| {
            if sum(&frame.valid) < frame.valid.len() as f32 {
                return f64::NAN;
            }
            let mut interior = ZERO_ROWS;
            for k in 0..ZERO_ROWS.len() {
                interior[k] = INTERIOR[k] * frame.values[k + SIDE];
            }
            f64::from(sum(&interior)) / SAMPLES as f64
        });
        means.collect()
    }

    /// Counts the residuals from the plain mean into `histogram`, and the texture, if it has no
    /// gaps, into `spectrum`, if there is one.
    ///
    /// Where n observers have a value, a residual is scaled by `√(n/(n−1))`, as its own value is
    /// part of the mean; where there is only one, it is the mean and tells nothing.
    #[inline(always)]
    pub fn count_residuals<'a>(
        &mut self,
        points: &TilePoints,
        observations: impl Iterator<Item = TileObservation<'a>>,
        histogram: &mut NoiseHistogram,
        spectrum: Option<&mut TextureSpectrum>,
    ) {
        self.sample(points, observations);
        let mean = self.mean();
        let mut values = ZERO_ROWS;
        for frame in &self.frames {
            for (n, valid) in values.iter_mut().zip(&frame.valid[SIDE..]) {
                *n += valid;
            }
        }
        if let Some(spectrum) = spectrum.filter(|_| !self.has_gaps) {
            spectrum.add(&mean, self.shares());
        }
        let gains: f32 = self.frames.iter().map(|frame| frame.gain.powi(2)).sum();
        let square_gain = gains / self.frames.len().max(1) as f32;
        // Of the mean: a single frame's gradient would correlate with its own noise.
        let squares = squared_gradients(&mean);
        for frame in &self.frames {
            for k in 0..ZERO_ROWS.len() {
                let c = k + SIDE;
                let n = values[k];
                if INTERIOR[k] * frame.valid[c] > 0.0 && n > 1.0 {
                    let scale = (n / (n - 1.0)).sqrt();
                    let e = frame.gain * (frame.values[c] - mean[c]);
                    histogram.add(scale * e, square_gain * squares[k]);
                }
            }
        }
    }

    /// Variance of the noise of S over that of a frame ([`crate::tiles::denoising`]).
    #[inline(always)]
    pub fn noise_gain(&self) -> f32 {
        let (mut total, mut square) = (0.0f32, 0.0f32);
        for frame in &self.frames {
            // w/a = q a.
            let weight = frame.pixels * frame.gain;
            total += weight * frame.gain;
            square += weight * weight;
        }
        square / (total * total).max(f32::MIN_POSITIVE)
    }

    /// Values, gain and share of the weight of each observer ([`crate::tiles::denoising`]).
    fn shares(&self) -> impl Iterator<Item = TileFrame<'_>> {
        let weight = |frame: &FrameValues| f64::from(frame.pixels * frame.gain * frame.gain);
        let total: f64 = self.frames.iter().map(weight).sum();
        self.frames.iter().map(move |frame| TileFrame {
            values: &frame.values,
            gain: f64::from(frame.gain),
            share: weight(frame) / total,
        })
    }
}
