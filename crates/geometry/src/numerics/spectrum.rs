//! Two-dimensional Fourier transforms of real rasters, for correlation over all shifts at once.

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::ops::Range;
use std::sync::Arc;

/// Rows that are copied between rasters and spectra at once: their values of a column share two
/// cache lines.
const ROWS_AT_ONCE: usize = 16;

/// Half spectrum of a real raster: its first `columns/2 + 1` columns, one after the other.
pub type Spectrum = Vec<Complex<f32>>;

/// The half spectrum of a real signal of `n` values: `n/2 + 1` values. The signal is overwritten.
pub fn half_spectrum(signal: &mut [f32]) -> Spectrum {
    let plan = RealFftPlanner::new().plan_fft_forward(signal.len());
    let mut spectrum = plan.make_output_vec();
    // The lengths match the plan.
    let _ = plan.process(signal, &mut spectrum);
    spectrum
}

/// Transforms of rasters of one size.
pub struct Transform {
    /// Columns of the raster.
    pub columns: usize,
    /// Rows of the raster.
    pub rows: usize,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    down: Arc<dyn Fft<f32>>,
    up: Arc<dyn Fft<f32>>,
}

impl Transform {
    /// Creates transforms for rasters of at least `columns × rows`, rounded up to sizes that
    /// transform fast (`2^a 3^b 5^c`).
    pub fn at_least(columns: usize, rows: usize) -> Self {
        let (columns, rows) = (fast_size(columns), fast_size(rows));
        let mut real = RealFftPlanner::new();
        let mut complex = FftPlanner::new();
        Self {
            columns,
            rows,
            forward: real.plan_fft_forward(columns),
            inverse: real.plan_fft_inverse(columns),
            down: complex.plan_fft_forward(rows),
            up: complex.plan_fft_inverse(rows),
        }
    }

    fn width(&self) -> usize {
        self.columns / 2 + 1
    }

    /// Transforms a raster, row-major, to its half spectrum. Rows of zeros take no time.
    pub fn forward(&self, mut raster: Vec<f32>) -> Spectrum {
        let width = self.width();
        let mut spectrum = vec![Complex::default(); width * self.rows];
        let mut lines = vec![Complex::default(); width * ROWS_AT_ONCE];
        let mut scratch = self.forward.make_scratch_vec();
        let blocks = raster.chunks_mut(self.columns * ROWS_AT_ONCE);
        for (block, first) in blocks.zip((0..).step_by(ROWS_AT_ONCE)) {
            if block.iter().all(|value| *value == 0.0) {
                continue;
            }
            let rows = block.chunks_exact_mut(self.columns);
            let count = rows.len();
            for (row, line) in rows.zip(lines.chunks_exact_mut(width)) {
                // The lengths match the plan.
                let _ = self.forward.process_with_scratch(row, line, &mut scratch);
            }
            let columns = spectrum.chunks_exact_mut(self.rows).enumerate();
            for (x, column) in columns {
                for (k, value) in column[first..first + count].iter_mut().enumerate() {
                    *value = lines[k * width + x];
                }
            }
        }
        self.down.process(&mut spectrum);
        spectrum
    }

    /// The correlation `C(d) = Σ_x a(x) b(x + d)` (cyclic) of two rasters from their spectra: the
    /// inverse transform of `Ā B`, for shifts `d` along the columns in a range; row-major, a row
    /// for each of them.
    pub fn correlate(&self, a: &Spectrum, b: &Spectrum, shifts: Range<i64>) -> Vec<f32> {
        let width = self.width();
        let mut product: Spectrum = a.iter().zip(b).map(|(a, b)| a.conj() * b).collect();
        self.up.process(&mut product);
        let rows: Vec<usize> = shifts
            .map(|shift| shift.rem_euclid(self.rows as i64) as usize)
            .collect();
        let mut raster = vec![0.0; self.columns * rows.len()];
        let mut lines = vec![Complex::default(); width * ROWS_AT_ONCE];
        let mut scratch = self.inverse.make_scratch_vec();
        let blocks = raster.chunks_mut(self.columns * ROWS_AT_ONCE);
        for (block, rows) in blocks.zip(rows.chunks(ROWS_AT_ONCE)) {
            for (x, column) in product.chunks_exact(self.rows).enumerate() {
                for (k, row) in rows.iter().enumerate() {
                    lines[k * width + x] = column[*row];
                }
            }
            let out = block.chunks_exact_mut(self.columns);
            for (line, out) in lines.chunks_exact_mut(width).zip(out) {
                // These are real up to rounding, as the plan requires.
                line[0].im = 0.0;
                if self.columns.is_multiple_of(2) {
                    line[width - 1].im = 0.0;
                }
                let _ = self.inverse.process_with_scratch(line, out, &mut scratch);
            }
        }
        let scale = 1.0 / (self.columns * self.rows) as f32;
        raster.iter_mut().for_each(|value| *value *= scale);
        raster
    }
}

/// The smallest size from `least` on without prime factors above 5.
fn fast_size(least: usize) -> usize {
    (least.max(4)..)
        .find(|n| {
            let mut n = *n;
            for prime in [2, 3, 5] {
                while n.is_multiple_of(prime) {
                    n /= prime;
                }
            }
            n == 1
        })
        .unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_agrees_with_the_sum() {
        let transform = Transform::at_least(11, 39);
        let (w, h) = (transform.columns, transform.rows);
        assert_eq!((w, h), (12, 40));
        let mut a: Vec<f32> = (0..w * h).map(|k| (1.7 * k as f32).sin()).collect();
        a[16 * w..32 * w].fill(0.0);
        let b: Vec<f32> = (0..w * h).map(|k| (0.3 * (k * k) as f32).cos()).collect();
        let spectra = [&a, &b].map(|raster| transform.forward(raster.clone()));
        let c = transform.correlate(&spectra[0], &spectra[1], -2..20);
        assert_eq!(c.len(), 22 * w);
        for (dx, dy) in [(0, -2), (3, 1), (11, 7), (2, 19)] {
            let mut sum = 0.0;
            for y in 0..h {
                for x in 0..w {
                    let row = (y as i64 + dy).rem_euclid(h as i64) as usize;
                    sum += a[y * w + x] * b[row * w + (x + dx) % w];
                }
            }
            let row = (dy + 2) as usize;
            assert!((c[row * w + dx] - sum).abs() < 1e-3);
        }
    }
}
