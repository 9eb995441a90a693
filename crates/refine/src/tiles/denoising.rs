//! Wiener filter of the fused texture, for its slopes.
//!
//! The derivative of a residual contains the slopes of the fused texture S, and S is noisy. On a
//! wall of low contrast most of a slope between neighbouring samples is noise, and the score
//! `Σ e φ` then contains products of noise with noise. At full size the slopes are therefore those
//! of the linear minimum mean square error estimate of the texture.
//!
//! A tile of S (10 × 10 samples with its ring) is expanded in polynomials `p_k(s) p_l(h)`,
//! orthonormal on the samples, so that a ramp is one of them and does not bend at the tile's
//! border. Texture is the wall's reflectance in some light: where there is less light, it has less
//! contrast, and the noise is the same. So a coefficient `c_kl` has the variance `t_kl c_00²` by
//! texture, in proportion to the square of the tile's mean, and `n_kl` by noise. The filter
//! multiplies it by
//!
//! `W_kl = t_kl c_00²/(t_kl c_00² + n_kl)`,   `t_kl = Σ (c_kl² − n_kl)/Σ c_00²`
//!
//! over many tiles of the wall. With the same t and n everywhere, frames of a wall's dark side
//! would be taken for as certain as those of its bright one. (Pictures that are normalised locally
//! have the same mean everywhere.)
//!
//! Let `φ̂` be the slopes of the filtered texture. The mean of `φ̂φ̂ᵀ` is that of `φ̂φᵀ` with the
//! true slopes φ, the derivative of the score; so M needs no correction for noise.
//!
//! With `S = Σ w_i z_i / W`, `w_i = q_i a_i²` and `W = Σ w_i`, and the variance `s_kl/a_i²` of a
//! coefficient of `z_i`,
//!
//! `n_kl = s_kl u`,   `u = Σ_i (w_i/a_i W)²`.
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
    /// Square `c_00²` of the mean, and noise gain u, of every tile.
    tiles: Vec<(f64, f64)>,
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

impl TileFrame<'_> {
    /// Its part of the noise gain u: `(w/a W)²`.
    fn noise_gain(&self) -> f64 {
        (self.share / self.gain).powi(2)
    }
}

impl Default for TextureSpectrum {
    fn default() -> Self {
        Self {
            basis: polynomials(),
            squares: [[0.0; SIDE]; SIDE],
            tiles: Vec::new(),
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
        let mut noise_gain = 0.0;
        for frame in frames {
            noise_gain += frame.noise_gain();
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
        self.tiles.push((coefficients[0][0].powi(2), noise_gain));
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
        self.tiles.extend(other.tiles);
        self.residuals.extend(other.residuals);
        self
    }

    /// The filter of the texture.
    pub fn denoiser(&self) -> Denoiser {
        let noise = self.noise_spectrum();
        let texture = self.texture_spectrum(&noise);
        Denoiser {
            slope_noise: self.slope_noise(&texture, &noise),
            basis: self.basis.map(|p| p.map(|v| v as f32)),
            transposed: std::array::from_fn(|i| std::array::from_fn(|k| self.basis[k][i] as f32)),
            texture: texture.map(|row| row.map(|t| t as f32)),
            noise: noise.map(|row| row.map(|s| s as f32)),
        }
    }

    /// `t_kl`, l the row; `noise`: `s_kl`.
    fn texture_spectrum(&self, noise: &Square<f64>) -> Square<f64> {
        let sum = |sum: (f64, f64), tile: &(f64, f64)| (sum.0 + tile.0, sum.1 + tile.1);
        let (level, noise_gain) = self.tiles.iter().fold((0.0, 0.0), sum);
        let texture = |l: usize, k: usize| {
            let of_texture = self.squares[l][k] - noise[l][k] * noise_gain;
            of_texture.max(0.0) / level.max(f64::MIN_POSITIVE)
        };
        std::array::from_fn(|l| std::array::from_fn(|k| texture(l, k)))
    }

    /// Share of the noise in the energy of the slopes of the filtered texture, 0 to 1; `texture`:
    /// `t_kl`, `noise`: `s_kl`.
    ///
    /// `Σ λ_kl W_kl² n_kl / Σ λ_kl W_kl² (t_kl c_00² + n_kl)` over all tiles, with the energy
    /// `λ_kl` of the slopes of `p_k p_l`.
    fn slope_noise(&self, texture: &Square<f64>, noise: &Square<f64>) -> f64 {
        let energy = self.basis.map(|p| -> f64 {
            let steps = p.iter().zip(&p[1..]).map(|(from, to)| (to - from).powi(2));
            steps.sum()
        });
        let (mut of_noise, mut of_all) = (0.0, 0.0);
        for (level, noise_gain) in &self.tiles {
            for (l, (texture, noise)) in texture.iter().zip(noise).enumerate() {
                for (k, (texture, noise)) in texture.iter().zip(noise).enumerate() {
                    let (texture, noise) = (texture * level, noise * noise_gain);
                    let all = texture + noise;
                    let filter = texture / all.max(f64::MIN_POSITIVE);
                    let weight = (energy[k] + energy[l]) * filter.powi(2);
                    of_noise += weight * noise;
                    of_all += weight * all;
                }
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
    /// `t_kl`, l (along h) the row.
    texture: Square<f32>,
    /// `s_kl`, l the row.
    noise: Square<f32>,
}

impl Denoiser {
    /// Filters a tile of S with the noise gain u.
    #[inline(always)]
    pub fn apply(&self, texture: &Plane, noise_gain: f32) -> Plane {
        let mut samples = [[0.0f32; SIDE]; SIDE];
        for (row, samples) in samples.iter_mut().zip(texture.chunks_exact(SIDE)) {
            row.copy_from_slice(samples);
        }
        let mut coefficients = product(&product(&self.basis, &samples), &self.transposed);
        let level = coefficients[0][0] * coefficients[0][0];
        let spectra = self.texture.iter().zip(&self.noise);
        for (row, (texture, noise)) in coefficients.iter_mut().zip(spectra) {
            for (c, (texture, noise)) in row.iter_mut().zip(texture.iter().zip(noise)) {
                let texture = texture * level;
                *c *= texture / (texture + noise * noise_gain).max(f32::MIN_POSITIVE);
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

    /// Ramps in uncorrelated noise, seen by two frames, in two lights: the slopes of the filtered
    /// tiles have a smaller error than those of the noisy ones, and `φ̂²` is on average `φ̂φ`, in
    /// the dark as in the light.
    #[test]
    fn filtered_slopes_are_nearer_to_the_truth_and_their_squares_unbiased() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let slopes = Normal::new(0.0f32, 0.5).unwrap();
        let noise = Normal::new(0.0f32, 2.0).unwrap();
        let mut spectrum = TextureSpectrum::default();
        let lights = [1.0f32, 0.2];
        let tiles: Vec<(f32, Plane)> = (0..8000)
            .map(|n| {
                let light = lights[n % 2];
                let slope = light * slopes.sample(&mut rng);
                let mut frame = || {
                    let mut tile = ZERO;
                    for (k, value) in tile[..SIDE * SIDE].iter_mut().enumerate() {
                        let x = (k % SIDE) as f32 - 0.5 * (SIDE - 1) as f32;
                        *value = 100.0 * light + slope * x + noise.sample(&mut rng);
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
        for (first, light) in lights.iter().enumerate() {
            let (mut before, mut after, mut square, mut product) = (0.0, 0.0, 0.0, 0.0);
            for (slope, tile) in tiles[first..].iter().step_by(2) {
                let clean = denoiser.apply(tile, 0.5);
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
            assert!(after < 0.05 * before, "{light}: {before} → {after}");
            let ratio = square / product;
            assert!((ratio - 1.0).abs() < 0.1, "{light}: {square} {product}");
        }
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
        let filtered = denoiser.apply(&tile, 0.5);
        assert!(
            tile.iter()
                .zip(&filtered)
                .all(|(a, b)| (a - b).abs() < 1e-3)
        );
    }
}
