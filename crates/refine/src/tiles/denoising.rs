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
//! With `S = Σ w_i z_i / W`, `w_i = q_i a_i²` and `W = Σ w_i`, and the variance `s_kl/a_i²` of a
//! coefficient of `z_i`, on average over the tiles
//!
//! `n_kl = s_kl ⟨Σ_i u_i⟩`, `u_i = (w_i/a_i W)²`.
//!
//! `s_kl` is measured: a coefficient `ρ` of a residual `z_i − S` has the variance
//! `s_kl (1 − w_i/W)/a_i²`. Pixels of a sensor are independent, but compression takes noise from
//! the high frequencies and adds some to the low ones, where the texture is; oblique frames and
//! interpolation correlate it, too.
//!
//! Source: N. Wiener, "Extrapolation, Interpolation, and Smoothing of Stationary Time Series",
//! 1949; J. P. Gram, "Ueber die Entwickelung reeller Functionen in Reihen mittelst der Methode der
//! kleinsten Quadrate", 1883 (the polynomials).

use crate::tiles::grid::{Plane, SIDE, ZERO};
use tunnelstitch_geometry::numerics::median::upper_fence;

type Square<T> = [[T; SIDE]; SIDE];

/// Sums of the squared coefficients of the texture over tiles of the wall, and the coefficients of
/// its noise.
#[derive(Clone, Debug)]
pub struct TextureSpectrum {
    /// `p_k(i)`, k the row.
    basis: Square<f64>,
    /// `Σ c_kl²`, l the row.
    squares: Square<f64>,
    /// `Σ u`.
    noise_gain: f64,
    /// `a² ρ_kl²/(1 − w/W)` of every frame of every tile.
    residuals: Vec<Square<f32>>,
}

/// A frame of a tile: its values, its gain a, and its share `w/W` of the weight.
pub struct TileFrame<'a> {
    /// Values z at every wall sample.
    pub values: &'a Plane,
    /// Gain a, shading included.
    pub gain: f64,
    /// Share of the weight, 0 to 1.
    pub share: f64,
}

impl Default for TextureSpectrum {
    fn default() -> Self {
        Self {
            basis: polynomials(),
            squares: [[0.0; SIDE]; SIDE],
            noise_gain: 0.0,
            residuals: Vec::new(),
        }
    }
}

impl TextureSpectrum {
    /// Adds a tile of S that `frames` are fused to.
    pub fn add<'a>(&mut self, texture: &Plane, frames: impl Iterator<Item = TileFrame<'a>>) {
        let coefficients = self.coefficients(texture);
        let squares = self.squares.iter_mut().flatten();
        squares
            .zip(coefficients.iter().flatten())
            .for_each(|(sum, c)| *sum += c * c);
        for frame in frames {
            self.noise_gain += (frame.share / frame.gain).powi(2);
            // S of a single frame leaves no residual.
            if frame.share == 1.0 {
                continue;
            }
            let mut residual = ZERO;
            let values = residual.iter_mut().zip(frame.values).zip(texture);
            values.for_each(|((e, z), s)| *e = z - s);
            let scale = frame.gain * frame.gain / (1.0 - frame.share);
            let coefficients = self.coefficients(&residual);
            self.residuals
                .push(coefficients.map(|row| row.map(|c| (scale * c * c) as f32)));
        }
    }

    /// The coefficients of a tile, l the row.
    fn coefficients(&self, tile: &Plane) -> Square<f64> {
        let mut along_s = [[0.0; SIDE]; SIDE];
        for (row, samples) in along_s.iter_mut().zip(tile.chunks_exact(SIDE)) {
            for (sum, p) in row.iter_mut().zip(&self.basis) {
                *sum = p.iter().zip(samples).map(|(p, t)| p * f64::from(*t)).sum();
            }
        }
        self.basis.map(|p| {
            std::array::from_fn(|k| p.iter().zip(&along_s).map(|(p, row)| p * row[k]).sum())
        })
    }

    /// Adds the sums of another spectrum.
    pub fn merge(mut self, other: Self) -> Self {
        let own = self.squares.iter_mut().flatten();
        own.zip(other.squares.iter().flatten())
            .for_each(|(a, b)| *a += b);
        self.noise_gain += other.noise_gain;
        self.residuals.extend(other.residuals);
        self
    }

    /// The filter of the texture.
    pub fn denoiser(&self) -> Denoiser {
        let noise = self.noise_spectrum();
        let factor = |l: usize, k: usize| {
            let noise = self.noise_gain * noise[l][k];
            (1.0 - noise / self.squares[l][k].max(f64::MIN_POSITIVE)).max(0.0) as f32
        };
        Denoiser {
            slope_noise: self.slope_noise(&noise),
            basis: self.basis.map(|p| p.map(|v| v as f32)),
            transposed: std::array::from_fn(|i| std::array::from_fn(|k| self.basis[k][i] as f32)),
            factors: std::array::from_fn(|l| std::array::from_fn(|k| factor(l, k))),
        }
    }

    /// Share of the noise in the energy of the slopes of the filtered texture, 0 to 1; `noise`:
    /// `s_kl`.
    ///
    /// `Σ λ_kl W_kl² n_kl / Σ λ_kl W_kl² m_kl`, with the energy `λ_kl` of the slopes of `p_k p_l`.
    fn slope_noise(&self, noise: &Square<f64>) -> f64 {
        let energy = self.basis.map(|p| -> f64 {
            let steps = p.iter().zip(&p[1..]).map(|(from, to)| (to - from).powi(2));
            steps.sum()
        });
        let (mut of_noise, mut of_all) = (0.0, 0.0);
        for (l, (noise, squares)) in noise.iter().zip(&self.squares).enumerate() {
            for (k, (noise, square)) in noise.iter().zip(squares).enumerate() {
                let noise = self.noise_gain * noise;
                let filter = (1.0 - noise / square.max(f64::MIN_POSITIVE)).max(0.0);
                let weight = (energy[k] + energy[l]) * filter.powi(2);
                of_noise += weight * noise;
                of_all += weight * square;
            }
        }
        // A texture of which nothing passes is all noise.
        if of_all > 0.0 { of_noise / of_all } else { 1.0 }
    }

    /// `s_kl`, l the row: means over the residuals whose energy `Σ ρ²` is not beyond
    /// [`upper_fence`], as that of edges and foreign objects; 0 for the mean of a tile, which has
    /// no slope and passes.
    fn noise_spectrum(&self) -> Square<f64> {
        let energy = |squares: &Square<f32>| squares.iter().flatten().sum::<f32>();
        let mut energies: Vec<f32> = self.residuals.iter().map(energy).collect();
        let most = upper_fence(&mut energies);
        let mut spectrum = [[0.0; SIDE]; SIDE];
        let mut counted = 0.0;
        for squares in self
            .residuals
            .iter()
            .filter(|squares| energy(squares) <= most)
        {
            counted += 1.0;
            let sums = spectrum.iter_mut().flatten();
            let squares = squares.iter().flatten();
            sums.zip(squares)
                .for_each(|(sum, square)| *sum += f64::from(*square));
        }
        spectrum[0][0] = 0.0;
        spectrum.map(|row| row.map(|sum| sum / f64::max(counted, 1.0)))
    }
}

/// Wiener filter of a tile.
#[derive(Clone, Debug)]
pub struct Denoiser {
    /// Share of the noise in the energy of the slopes of filtered textures, 0 to 1.
    pub slope_noise: f64,
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

    /// Ramps in uncorrelated noise, seen by two frames: the slopes of the filtered tiles have a
    /// smaller error than those of the noisy ones, and `φ̂²` is on average `φ̂φ`.
    #[test]
    fn filtered_slopes_are_nearer_to_the_truth_and_their_squares_unbiased() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let slopes = Normal::new(0.0f32, 0.5).unwrap();
        let noise = Normal::new(0.0f32, 2.0).unwrap();
        let mut spectrum = TextureSpectrum::default();
        let tiles: Vec<(f32, Plane)> = (0..2000)
            .map(|_| {
                let slope = slopes.sample(&mut rng);
                let mut frame = || {
                    let mut tile = ZERO;
                    for (k, value) in tile[..SIDE * SIDE].iter_mut().enumerate() {
                        *value = slope * (k % SIDE) as f32 + noise.sample(&mut rng);
                    }
                    tile
                };
                let frames = [frame(), frame()];
                let texture = mean_of(&frames);
                spectrum.add(&texture, frames.iter().map(half_of));
                (slope, texture)
            })
            .collect();
        let denoiser = spectrum.denoiser();
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

    /// The mean of two frames.
    fn mean_of(frames: &[Plane; 2]) -> Plane {
        std::array::from_fn(|k| 0.5 * (frames[0][k] + frames[1][k]))
    }

    /// A frame of gain 1 with half of the weight.
    fn half_of(values: &Plane) -> TileFrame<'_> {
        TileFrame {
            values,
            gain: 1.0,
            share: 0.5,
        }
    }

    #[test]
    fn filter_without_noise_changes_nothing() {
        let mut tile = ZERO;
        for (k, value) in tile[..SIDE * SIDE].iter_mut().enumerate() {
            *value = (7.3 * k as f32).sin() * 50.0;
        }
        let mut spectrum = TextureSpectrum::default();
        spectrum.add(&tile, [half_of(&tile), half_of(&tile)].into_iter());
        let denoiser = spectrum.denoiser();
        let filtered = denoiser.apply(&tile);
        assert!(
            tile.iter()
                .zip(&filtered)
                .all(|(a, b)| (a - b).abs() < 1e-3)
        );
    }
}
