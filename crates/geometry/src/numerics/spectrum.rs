//! Two-dimensional Fourier transforms of real rasters, for correlation over all shifts at once.

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Half spectrum of a real raster: `columns/2 + 1` values a row.
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

    /// Transforms a raster, row-major, to its half spectrum.
    pub fn forward(&self, mut raster: Vec<f32>) -> Spectrum {
        let width = self.width();
        let mut spectrum = vec![Complex::default(); width * self.rows];
        let rows = raster.chunks_exact_mut(self.columns);
        for (row, out) in rows.zip(spectrum.chunks_exact_mut(width)) {
            // The lengths match the plan.
            let _ = self.forward.process(row, out);
        }
        self.along_columns(&mut spectrum, self.down.as_ref());
        spectrum
    }

    /// The correlation `C(d) = Σ_x a(x) b(x + d)` (cyclic) of two rasters from their spectra: the
    /// inverse transform of `Ā B`.
    pub fn correlate(&self, a: &Spectrum, b: &Spectrum) -> Vec<f32> {
        let width = self.width();
        let mut product: Spectrum = a.iter().zip(b).map(|(a, b)| a.conj() * b).collect();
        self.along_columns(&mut product, self.up.as_ref());
        let mut raster = vec![0.0; self.columns * self.rows];
        let rows = product.chunks_exact_mut(width);
        for (row, out) in rows.zip(raster.chunks_exact_mut(self.columns)) {
            // These are real up to rounding, as the plan requires.
            row[0].im = 0.0;
            if self.columns.is_multiple_of(2) {
                row[width - 1].im = 0.0;
            }
            let _ = self.inverse.process(row, out);
        }
        let scale = 1.0 / (self.columns * self.rows) as f32;
        raster.iter_mut().for_each(|value| *value *= scale);
        raster
    }

    fn along_columns(&self, spectrum: &mut Spectrum, plan: &dyn Fft<f32>) {
        let width = self.width();
        let mut transposed = vec![Complex::default(); spectrum.len()];
        for (y, row) in spectrum.chunks_exact(width).enumerate() {
            for (x, value) in row.iter().enumerate() {
                transposed[x * self.rows + y] = *value;
            }
        }
        plan.process(&mut transposed);
        for (y, row) in spectrum.chunks_exact_mut(width).enumerate() {
            for (x, value) in row.iter_mut().enumerate() {
                *value = transposed[x * self.rows + y];
            }
        }
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
        let transform = Transform::at_least(11, 7);
        let (w, h) = (transform.columns, transform.rows);
        assert_eq!((w, h), (12, 8));
        let a: Vec<f32> = (0..w * h).map(|k| (1.7 * k as f32).sin()).collect();
        let b: Vec<f32> = (0..w * h).map(|k| (0.3 * (k * k) as f32).cos()).collect();
        let c = transform.correlate(&transform.forward(a.clone()), &transform.forward(b.clone()));
        for (dx, dy) in [(0, 0), (3, 1), (11, 7)] {
            let mut sum = 0.0;
            for y in 0..h {
                for x in 0..w {
                    sum += a[y * w + x] * b[(y + dy) % h * w + (x + dx) % w];
                }
            }
            assert!((c[dy * w + dx] - sum).abs() < 1e-3);
        }
    }
}
