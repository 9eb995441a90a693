//! A smooth function of the wall, tabulated.
//!
//! Rays ask for it some ten times each, and a sum of hundreds of cosines takes a microsecond.

use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Samples in a correlation length. Between them, the interpolation errs by less than a thousandth
/// of the function.
const SAMPLES_PER_LENGTH: f64 = 10.0;

/// A function of angle and chainage that is periodic in both.
///
/// Between its samples it is interpolated by cubic convolution (R. Keys, "Cubic convolution
/// interpolation for digital image processing", IEEE Transactions on Acoustics, Speech, and Signal
/// Processing 29(6), 1981, a = −1/2), which is continuous with its slope.
#[derive(Clone, Debug)]
pub(super) struct PeriodicTable {
    columns: usize,
    rows: usize,
    /// Period along the axis, metres.
    period_m: f64,
    /// Samples, row by row.
    samples: Arc<[f64]>,
}

impl PeriodicTable {
    /// Tabulates `f(θ, h)` that repeats itself after `perimeter_m` around and `period_m` along, and
    /// changes over `length_m` (all metres).
    pub fn new(
        perimeter_m: f64,
        period_m: f64,
        length_m: f64,
        f: impl Fn(f64, f64) -> f64 + Sync,
    ) -> Self {
        let count = |extent_m: f64| (extent_m / length_m * SAMPLES_PER_LENGTH).ceil().max(16.0);
        let (columns, rows) = (count(perimeter_m) as usize, count(period_m) as usize);
        let sample = |index: usize| {
            let theta = (index % columns) as f64 / columns as f64 * TAU;
            f(theta, (index / columns) as f64 / rows as f64 * period_m)
        };
        let samples: Vec<f64> = (0..rows * columns).into_par_iter().map(sample).collect();
        Self {
            columns,
            rows,
            period_m,
            samples: samples.into(),
        }
    }

    /// The function at an angle, radians, and a chainage, metres.
    pub fn at(&self, theta: f64, h_m: f64) -> f64 {
        let (columns, across) = taps(theta / TAU, self.columns);
        let (rows, along) = taps(h_m / self.period_m, self.rows);
        let row = |j: usize| -> f64 {
            let samples = &self.samples[rows[j] * self.columns..][..self.columns];
            (0..4).map(|i| across[i] * samples[columns[i]]).sum()
        };
        (0..4).map(|j| along[j] * row(j)).sum()
    }
}

/// The four samples about a place, in periods, of `count` samples a period, and their weights.
fn taps(periods: f64, count: usize) -> ([usize; 4], [f64; 4]) {
    let place = (periods - periods.floor()) * count as f64;
    let first = place.floor();
    let x = place - first;
    let weights = [
        ((-0.5 * x + 1.0) * x - 0.5) * x,
        (1.5 * x - 2.5) * x * x + 1.0,
        ((-1.5 * x + 2.0) * x + 0.5) * x,
        (0.5 * x - 0.5) * x * x,
    ];
    let first = first as usize + count - 1;
    ([0, 1, 2, 3].map(|k| (first + k) % count), weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_is_interpolated_and_repeats_itself() {
        let wave = |theta: f64, h_m: f64| (3.0 * theta + 0.2).sin() * (TAU * h_m / 4.0).cos();
        let table = PeriodicTable::new(TAU, 8.0, 0.5, wave);
        for k in 0..500 {
            let (theta, h_m) = (0.37 * f64::from(k) - 90.0, 0.11 * f64::from(k) - 20.0);
            assert!((table.at(theta, h_m) - wave(theta, h_m)).abs() < 1e-3);
        }
        assert!((table.at(0.3, 1.7) - table.at(0.3 + TAU, 1.7 - 8.0)).abs() < 1e-12);
        assert!(table.at(f64::NAN, 0.0).is_nan());
    }
}
