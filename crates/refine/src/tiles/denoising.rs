//! Wiener filter of the fused texture, for its slopes.
//!
//! The derivative of a residual contains the slopes of the fused texture S, and S is noisy. On a
//! wall of low contrast most of a slope between neighbouring samples is noise, and the score
//! `Σ e φ` then contains products of noise with noise. At full size the slopes are therefore those
//! of the linear minimum mean square error estimate of the texture.
//!
//! A tile of S (10 × 10 samples with its ring) is expanded in polynomials `p_k(s) p_l(h)`,
//! orthonormal on the samples, so that a ramp is one of them and does not bend at the tile's
//! border. A coefficient `c_kl` has the noise variance `n_kl` and, over many tiles of the wall, the
//! mean square `m_kl`. The filter multiplies it by
//!
//! `W_kl = max(0, 1 − n_kl/m_kl)`.
//!
//! Let `φ̂` be the slopes of the filtered texture. The mean of `φ̂φ̂ᵀ` is that of `φ̂φᵀ` with the
//! true slopes φ, the derivative of the score; so M needs no correction for noise.
//!
//! With `S = Σ q_i a_i² z_i / Σ q_i a_i²`, the noise of `z_i` has the variance `σ²/a_i²` and, along
//! each axis, the autocorrelation `β(d)/β(0)` of the interpolation kernel at a distance of d pixels
//! ([`Interpolation::autocorrelation`]). Samples of frame i are `d_i = √q_i` pixels apart, so that
//! on average over the tiles
//!
//! `n_kl = σ² ⟨Σ_i u_i ν_k(d_i) ν_l(d_i)⟩`, `u_i = (q_i a_i)² / (Σ_j q_j a_j²)²`,
//! `ν_k(d) = Σ_ij p_k(i) p_k(j) β(|i − j| d)/β(0)`.
//!
//! An oblique frame has fewer pixels per sample: its noise is more correlated between samples.
//!
//! Source: N. Wiener, "Extrapolation, Interpolation, and Smoothing of Stationary Time Series",
//! 1949; J. P. Gram, "Ueber die Entwickelung reeller Functionen in Reihen mittelst der Methode der
//! kleinsten Quadrate", 1883 (the polynomials).

use crate::tiles::grid::{Plane, SIDE, ZERO};
use crate::tiles::interpolation::Interpolation;

type Square<T> = [[T; SIDE]; SIDE];

/// Sums of the squared coefficients and of the noise gains over tiles of the wall.
#[derive(Clone, Debug)]
pub struct TextureSpectrum {
    /// `p_k(i)`, k the row.
    basis: Square<f64>,
    /// `Σ c_kl²`, l the row.
    squares: Square<f64>,
    /// `Σ u` by the spacing d, in bins of [`SPACING_PX`].
    noise_gains: [f64; SPACINGS],
}

/// Width of a bin of spacings, pixels.
const SPACING_PX: f64 = 1.0 / 32.0;
/// Number of bins of spacings; the last one holds all larger ones.
const SPACINGS: usize = 64;

impl Default for TextureSpectrum {
    fn default() -> Self {
        Self {
            basis: polynomials(),
            squares: [[0.0; SIDE]; SIDE],
            noise_gains: [0.0; SPACINGS],
        }
    }
}

impl TextureSpectrum {
    /// Adds a tile of S; `frames` gives `(d_i, u_i)` of each frame.
    pub fn add(&mut self, texture: &Plane, frames: impl Iterator<Item = (f64, f64)>) {
        let mut along_s = [[0.0; SIDE]; SIDE];
        for (row, samples) in along_s.iter_mut().zip(texture.chunks_exact(SIDE)) {
            for (sum, p) in row.iter_mut().zip(&self.basis) {
                *sum = p.iter().zip(samples).map(|(p, t)| p * f64::from(*t)).sum();
            }
        }
        for (squares, p) in self.squares.iter_mut().zip(&self.basis) {
            for (k, square) in squares.iter_mut().enumerate() {
                let c: f64 = p.iter().zip(&along_s).map(|(p, row)| p * row[k]).sum();
                *square += c * c;
            }
        }
        for (spacing_px, gain) in frames {
            let bin = (spacing_px / SPACING_PX) as usize;
            self.noise_gains[bin.min(SPACINGS - 1)] += gain;
        }
    }

    /// Adds the sums of another spectrum.
    pub fn merge(mut self, other: &Self) -> Self {
        let others = other.squares.iter().flatten().chain(&other.noise_gains);
        let own = self
            .squares
            .iter_mut()
            .flatten()
            .chain(&mut self.noise_gains);
        own.zip(others).for_each(|(a, b)| *a += b);
        self
    }

    /// The filter for samples with noise of the variance `floor`, σ² (grey levels²).
    pub fn denoiser(&self, floor: f64, interpolation: Interpolation) -> Denoiser {
        let mut noise = [[0.0; SIDE]; SIDE];
        let gains = self.noise_gains.iter().enumerate();
        for (bin, u) in gains.filter(|(_, u)| **u > 0.0) {
            let nu = self.nu((bin as f64 + 0.5) * SPACING_PX, interpolation);
            for (row, nu_l) in noise.iter_mut().zip(&nu) {
                for (noise, nu_k) in row.iter_mut().zip(&nu) {
                    *noise += floor * u * nu_l * nu_k;
                }
            }
        }
        // The mean has no slope: it passes.
        noise[0][0] = 0.0;
        let factor = |l: usize, k: usize| {
            (1.0 - noise[l][k] / self.squares[l][k].max(f64::MIN_POSITIVE)).max(0.0) as f32
        };
        Denoiser {
            basis: self.basis.map(|p| p.map(|v| v as f32)),
            transposed: std::array::from_fn(|i| std::array::from_fn(|k| self.basis[k][i] as f32)),
            factors: std::array::from_fn(|l| std::array::from_fn(|k| factor(l, k))),
        }
    }

    /// `ν_k` of samples `spacing_px` apart.
    fn nu(&self, spacing_px: f64, interpolation: Interpolation) -> [f64; SIDE] {
        let covariances: [f64; SIDE] =
            std::array::from_fn(|k| interpolation.autocorrelation(k as f64 * spacing_px));
        let correlation = |i: usize, j: usize| covariances[i.abs_diff(j)] / covariances[0];
        std::array::from_fn(|k| {
            let p = &self.basis[k];
            let pairs = (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j)));
            pairs.map(|(i, j)| p[i] * p[j] * correlation(i, j)).sum()
        })
    }
}

/// Wiener filter of a tile.
#[derive(Clone, Debug)]
pub struct Denoiser {
    /// `p_k(i)`, k the row.
    basis: Square<f32>,
    /// `p_k(i)`, k the column.
    transposed: Square<f32>,
    /// `W_kl`, l (along h) the row.
    factors: Square<f32>,
}

impl Denoiser {
    /// Filters a tile of S.
    #[inline(always)]
    pub fn apply(&self, texture: &Plane) -> Plane {
        let mut samples = [[0.0f32; SIDE]; SIDE];
        for (row, samples) in samples.iter_mut().zip(texture.chunks_exact(SIDE)) {
            row.copy_from_slice(samples);
        }
        let mut coefficients = product(&product(&self.basis, &samples), &self.transposed);
        for (row, factors) in coefficients.iter_mut().zip(&self.factors) {
            for (c, factor) in row.iter_mut().zip(factors) {
                *c *= factor;
            }
        }
        let filtered = product(&product(&self.transposed, &coefficients), &self.basis);
        let mut plane = ZERO;
        for (samples, row) in plane.chunks_exact_mut(SIDE).zip(&filtered) {
            samples.copy_from_slice(row);
        }
        plane
    }
}

/// Product of two matrices.
#[inline(always)]
fn product(a: &Square<f32>, b: &Square<f32>) -> Square<f32> {
    let mut product = [[0.0f32; SIDE]; SIDE];
    for (sums, a) in product.iter_mut().zip(a) {
        for (a, b) in a.iter().zip(b) {
            for (sum, b) in sums.iter_mut().zip(b) {
                *sum += a * b;
            }
        }
    }
    product
}

/// Polynomials of degree 0, 1, … (rows), orthonormal on [`SIDE`] evenly spaced points.
fn polynomials() -> Square<f64> {
    let mut basis = [[0.0; SIDE]; SIDE];
    for k in 0..SIDE {
        let x = |i: usize| (2 * i) as f64 / (SIDE - 1) as f64 - 1.0;
        let mut row: [f64; SIDE] = match k {
            0 => [1.0; SIDE],
            _ => std::array::from_fn(|i| x(i) * basis[k - 1][i]),
        };
        // Gram–Schmidt twice, against rounding.
        for _ in 0..2 {
            for earlier in &basis[..k] {
                let part: f64 = row.iter().zip(earlier).map(|(a, b)| a * b).sum();
                row.iter_mut()
                    .zip(earlier)
                    .for_each(|(a, b)| *a -= part * b);
            }
        }
        let norm = row.iter().map(|v| v * v).sum::<f64>().sqrt();
        basis[k] = row.map(|v| v / norm);
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn polynomials_are_orthonormal_and_the_second_is_a_ramp() {
        let basis = polynomials();
        for (k, a) in basis.iter().enumerate() {
            for (l, b) in basis.iter().enumerate() {
                let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let expected = if k == l { 1.0 } else { 0.0 };
                assert!((dot - expected).abs() < 1e-12);
            }
        }
        let step = basis[1][1] - basis[1][0];
        assert!(
            basis[1]
                .windows(2)
                .all(|p| (p[1] - p[0] - step).abs() < 1e-12)
        );
    }

    /// Ramps in uncorrelated noise: the slopes of the filtered tiles have a smaller error than
    /// those of the noisy ones, and `φ̂²` is on average `φ̂φ`.
    #[test]
    fn filtered_slopes_are_nearer_to_the_truth_and_their_squares_unbiased() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let (slopes, noise) = (
            Normal::new(0.0f32, 0.5).unwrap(),
            Normal::new(0.0f32, 2.0).unwrap(),
        );
        let mut spectrum = TextureSpectrum::default();
        let tiles: Vec<(f32, Plane)> = (0..2000)
            .map(|_| {
                let slope = slopes.sample(&mut rng);
                let mut tile = ZERO;
                for (k, value) in tile[..SIDE * SIDE].iter_mut().enumerate() {
                    *value = slope * (k % SIDE) as f32 + noise.sample(&mut rng);
                }
                // Two pixels apart: no correlation.
                spectrum.add(&tile, [(2.0, 1.0)].into_iter());
                (slope, tile)
            })
            .collect();
        let denoiser = spectrum.denoiser(4.0, Interpolation::Bilinear);
        let (mut before, mut after, mut square, mut product) = (0.0, 0.0, 0.0, 0.0);
        for (slope, tile) in &tiles {
            let clean = denoiser.apply(tile);
            for row in 1..SIDE - 1 {
                for k in row * SIDE + 1..(row + 1) * SIDE - 1 {
                    let at = |tile: &Plane| f64::from(0.5 * (tile[k + 1] - tile[k - 1]));
                    let (truth, noisy, filtered) = (f64::from(*slope), at(tile), at(&clean));
                    before += (noisy - truth).powi(2);
                    after += (filtered - truth).powi(2);
                    square += filtered * filtered;
                    product += filtered * truth;
                }
            }
        }
        assert!(after < 0.05 * before, "{before} → {after}");
        assert!((square / product - 1.0).abs() < 0.05, "{square} {product}");
    }

    #[test]
    fn filter_without_noise_changes_nothing() {
        let mut tile = ZERO;
        for (k, value) in tile[..SIDE * SIDE].iter_mut().enumerate() {
            *value = (7.3 * k as f32).sin() * 50.0;
        }
        let mut spectrum = TextureSpectrum::default();
        spectrum.add(&tile, [(0.5, 1.0)].into_iter());
        let denoiser = spectrum.denoiser(0.0, Interpolation::Bilinear);
        let filtered = denoiser.apply(&tile);
        assert!(
            tile.iter()
                .zip(&filtered)
                .all(|(a, b)| (a - b).abs() < 1e-3)
        );
    }
}
