//! Fisher information of displacements if the texture is known by its spectrum only.
//!
//! Let the texture be a Gaussian process with the power spectral density P, and let N frames with
//! pixel noise σ² observe it at the sub-pixel positions x_i. At one frequency their pixels show the
//! sum of all frequencies g that are aliases of each other, with the covariance
//!
//! `C = Σ_g P(g) a_g a_gᴴ + σ² I`,   `a_g = (exp(2πi g·x_i))_i`,
//!
//! in which the texture is integrated out. The Fisher information of the positions along one axis
//! is `F_ij = tr(C⁻¹ ∂_iC C⁻¹ ∂_jC)`. With `∂_iC = e_i bᴴ + b e_iᴴ`,
//! `b_j = Σ_g −2πi g P(g) ā_gi a_gj` for j ≠ i, `b_i = 0` (the two halves of the diagonal cancel),
//! and `G = C⁻¹`,
//!
//! `F_ii = 2 G_ii bᴴGb + 2 Re (e_iᴴGb)²`.
//!
//! For a known texture it is `J_ii = 2 Σ_g (2πg)² P(g)/σ² (1 − 1/N)`. On average over all positions
//! both matrices are multiples of `I − 11ᵀ/N`: all frames are equivalent, and a common displacement
//! is unobservable. The share `tr F / tr J` of the information remains, and the slopes are
//! multiplied by its root.
//!
//! Without aliases the share of a frequency is `Nρ/(1 + Nρ)`, `ρ = P/σ²`: detail below the noise of
//! the mean of all frames carries no information. With aliases it stays below 1 for any noise: they
//! must be separated from the same pixels, which takes as many frames as there are aliases.
//!
//! Source: W. J. Bangs, "Array processing with generalized beamformers", thesis, Yale, 1971; W. R.
//! Hahn and S. A. Tretter, "Optimum processing for delay-vector estimation in passive signal
//! arrays", IEEE Transactions on Information Theory 19(5), 1973; P. Stoica and A. Nehorai,
//! "Performance study of conditional and unconditional direction-of-arrival estimation", IEEE
//! Transactions on Acoustics, Speech, and Signal Processing 38(10), 1990 (the bound with a known
//! texture is not attained with any amount of data, this one is).

use nalgebra::{Complex, DMatrix, DVector, Matrix4};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::signal::{hann, sinc};
use tunnelstitch_geometry::numerics::spectrum::Transform;

/// Side of the patches whose periodograms are averaged, pixels of a frame.
const PATCH_PX: usize = 64;
/// Random frequencies by which the information is averaged.
const RANDOM_FREQUENCIES: usize = 800;
/// Random sets of sub-pixel positions for each of these frequencies.
const RANDOM_POSITION_SETS: usize = 4;
/// Largest number of frames that the information is computed for; beyond it hardly changes.
const MAX_TEXTURE_FRAMES: usize = 24;

/// Shares of the information of displacements, by the number of frames that observe a point of the
/// wall.
#[derive(Clone, Debug)]
pub struct UnknownTexture {
    /// Roots of the shares along s and h, for two frames and more.
    roots: Vec<[f64; 2]>,
}

impl UnknownTexture {
    /// Computes the shares for the texture of `wall` (columns along s, rows along h, at least
    /// [`UnknownTexture::min_side`] of each), which has `finer` pixels per pixel of a frame, with
    /// frame noise of `noise_grey` grey levels (1-σ).
    pub fn of_wall(wall: &GreyImage, finer: usize, noise_grey: f64) -> Self {
        let spectrum = WallSpectrum::of(wall, finer);
        let shares = (2..MAX_TEXTURE_FRAMES + 1)
            .par_map(|frames| spectrum.shares(frames, noise_grey).map(f64::sqrt));
        Self { roots: shares }
    }

    /// Least number of rows and columns of a wall with `finer` pixels per pixel of a frame.
    pub fn min_side(finer: usize) -> usize {
        PATCH_PX * finer
    }

    /// Reduces `M = Σ p φ φᵀ` of a tile with `frames` observers to the information of an unknown
    /// texture.
    pub fn reduce_information(&self, features: &mut Matrix4<f64>, frames: usize) {
        let Some(root) = self.roots.get(frames.clamp(2, MAX_TEXTURE_FRAMES) - 2) else {
            return;
        };
        for (k, root) in root.iter().enumerate() {
            features.row_mut(k).scale_mut(*root);
            features.column_mut(k).scale_mut(*root);
        }
    }
}

/// Power spectral density of the texture averaged over a frame's pixels, (grey level)² px².
struct WallSpectrum {
    /// At `(k_h, k_s)/`[`PATCH_PX`] cycles/px, row-major with negative frequencies last.
    density: Vec<f64>,
    side: usize,
    finer: usize,
}

impl WallSpectrum {
    /// Welch's method: the mean of the periodograms of patches that overlap by half, under Hann's
    /// window.
    fn of(wall: &GreyImage, finer: usize) -> Self {
        let side = UnknownTexture::min_side(finer);
        let transform = Transform::at_least(side, side);
        let hann = |k: usize| hann(k, side);
        let energy: f64 = (0..side).map(|k| hann(k).powi(2)).sum();
        let starts = |length: usize| (0..=length - side).step_by(side / 2);
        let positions: Vec<(usize, usize)> = starts(wall.height())
            .flat_map(|y| starts(wall.width()).map(move |x| (x, y)))
            .collect();
        let periodogram = |&(x, y): &(usize, usize)| {
            let pixels = || (0..side * side).map(|k| (k % side, k / side));
            let at = |(column, row): (usize, usize)| f64::from(wall.at(x + column, y + row));
            let mean = pixels().map(at).sum::<f64>() / (side * side) as f64;
            let windowed = |(column, row)| (at((column, row)) - mean) * hann(column) * hann(row);
            let patch = pixels().map(|pixel| windowed(pixel) as f32).collect();
            let half = transform.forward(patch);
            half.iter()
                .map(|value| f64::from(value.norm_sqr()))
                .collect()
        };
        let add = |mut a: Vec<f64>, b: Vec<f64>| {
            a.iter_mut().zip(&b).for_each(|(a, b)| *a += b);
            a
        };
        let width = side / 2 + 1;
        // In order, so that the sum does not depend on the number of threads.
        let mut half = vec![0.0; width * side];
        for run in positions.chunks(64) {
            let squares: Vec<Vec<f64>> = run.par_map(periodogram);
            half = squares.into_iter().fold(half, add);
        }
        let scale = 1.0 / (positions.len() as f64 * energy * energy * (finer * finer) as f64);
        // A pixel is the mean over its square; the wall's pixels are such means themselves.
        let smoothing = |k: usize| {
            let frequency = signed(k, side) as f64 / PATCH_PX as f64;
            (sinc(frequency) / sinc(frequency / finer as f64)).powi(2)
        };
        let density = (0..side * side).map(|k| {
            let (column, row) = (k % side, k / side);
            // The spectrum of a real image is symmetric about the origin.
            let square = if column < width {
                half[column * side + row]
            } else {
                half[(side - column) * side + (side - row) % side]
            };
            scale * square * smoothing(column) * smoothing(row)
        });
        Self {
            density: density.collect(),
            side,
            finer,
        }
    }

    /// `tr F / tr J` along s and h for `frames` frames, by a Monte Carlo sum over frequencies and
    /// positions with a fixed seed.
    fn shares(&self, frames: usize, noise_grey: f64) -> [f64; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(frames as u64);
        let half = (PATCH_PX / 2) as i64;
        let (mut found, mut known) = ([0.0; 2], [0.0; 2]);
        for _ in 0..RANDOM_FREQUENCIES {
            let base = [(); 2].map(|()| random.random_range(-half..half));
            let aliases = self.aliases(base);
            for _ in 0..RANDOM_POSITION_SETS {
                let positions = (0..frames).map(|_| [random.random(), random.random()]);
                let positions: Vec<[f64; 2]> = positions.collect();
                let [own, all] = information_traces(&aliases, &positions, noise_grey);
                for axis in 0..2 {
                    found[axis] += own[axis];
                    known[axis] += all[axis];
                }
            }
        }
        [0, 1].map(|axis| (found[axis] / known[axis]).min(1.0))
    }

    /// The aliases of the frequency `base`/[`PATCH_PX`], itself included.
    fn aliases(&self, base: [i64; 2]) -> Vec<Wave> {
        let most = (self.finer as i64 - 1) / 2;
        let alias = || -most..=most;
        let wave = |[a, b]: [i64; 2]| {
            let k = [base[0] + a * PATCH_PX as i64, base[1] + b * PATCH_PX as i64];
            let [column, row] = k.map(|k| k.rem_euclid(self.side as i64) as usize);
            Wave {
                frequency: k.map(|k| k as f64 / PATCH_PX as f64),
                power: self.density[row * self.side + column],
            }
        };
        alias()
            .flat_map(|a| alias().map(move |b| [a, b]))
            .map(wave)
            .collect()
    }
}

/// A frequency component of the texture.
struct Wave {
    /// Along s and h, cycles/px.
    frequency: [f64; 2],
    /// P.
    power: f64,
}

/// `tr F` and `tr J` along each axis for frames at the given `positions` (pixels along s and h).
fn information_traces(aliases: &[Wave], positions: &[[f64; 2]], noise_grey: f64) -> [[f64; 2]; 2] {
    let n = positions.len();
    let noise = noise_grey.powi(2);
    let amplitudes = DMatrix::from_fn(n, aliases.len(), |i, g| {
        let [s, h] = aliases[g].frequency;
        Complex::from_polar(1.0, TAU * (s * positions[i][0] + h * positions[i][1]))
    });
    let weighted = |weight: &dyn Fn(&Wave) -> Complex<f64>| {
        let weights = aliases.iter().map(weight);
        let weights = DVector::from_iterator(aliases.len(), weights);
        &amplitudes * DMatrix::from_diagonal(&weights) * amplitudes.adjoint()
    };
    let mut covariance = weighted(&|wave| wave.power.into());
    for i in 0..n {
        covariance[(i, i)] += noise;
    }
    // Hermitian and at least σ² I, so the factor exists.
    let Some(factor) = covariance.cholesky() else {
        return [[0.0; 2]; 2];
    };
    let inverse = factor.inverse();
    let of_axis = |axis: usize| {
        let slope = |wave: &Wave| TAU * wave.frequency[axis];
        let changes = weighted(&|wave| Complex::new(0.0, -slope(wave) * wave.power));
        let of_position = |i: usize| {
            let mut b = changes.column(i).into_owned();
            b[i] = Complex::ZERO;
            let gb = &inverse * &b;
            2.0 * (inverse[(i, i)].re * b.dotc(&gb).re + (gb[i] * gb[i]).re)
        };
        let steepness = aliases.iter().map(|wave| slope(wave).powi(2) * wave.power);
        let known = 2.0 * (n as f64 - 1.0) * steepness.sum::<f64>() / noise;
        ((0..n).map(of_position).sum(), known)
    };
    let [s, h]: [(f64, f64); 2] = [0, 1].map(of_axis);
    [[s.0, h.0], [s.1, h.1]]
}

/// Index `k` of a transform of `side` values as a signed frequency.
fn signed(k: usize, side: usize) -> i64 {
    if k < side / 2 {
        k as i64
    } else {
        k as i64 - side as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(frequency: [f64; 2], power: f64) -> Wave {
        Wave { frequency, power }
    }

    fn positions(count: usize) -> Vec<[f64; 2]> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let positions = (0..count).map(|_| [random.random(), random.random()]);
        positions.collect()
    }

    /// Bangs's closed form for one frequency: `F/J = Nρ/(1 + Nρ)`.
    #[test]
    fn share_without_aliases_is_that_of_the_closed_form() {
        for (count, power, noise) in [(2, 3.0, 1.0), (5, 0.1, 2.0), (9, 40.0, 0.5)] {
            let [found, known] =
                information_traces(&[wave([0.2, -0.3], power)], &positions(count), noise);
            let snr = count as f64 * power / (noise * noise);
            for axis in 0..2 {
                let share = found[axis] / known[axis];
                assert!(
                    (share - snr / (1.0 + snr)).abs() < 1e-12,
                    "{share} of {count}"
                );
            }
        }
    }

    /// `F_ii = tr(C⁻¹ ∂_iC C⁻¹ ∂_iC)` with ∂_iC by central differences.
    #[test]
    fn information_is_that_of_the_covariance() {
        let aliases = [
            wave([0.2, -0.3], 3.0),
            wave([-0.8, -0.3], 0.7),
            wave([0.2, 0.7], 0.4),
            wave([-0.8, 0.7], 0.2),
        ];
        let noise = 0.8;
        let covariance = |positions: &[[f64; 2]]| {
            DMatrix::from_fn(positions.len(), positions.len(), |i, j| {
                let term = |wave: &Wave| {
                    let phase =
                        (0..2).map(|k| wave.frequency[k] * (positions[i][k] - positions[j][k]));
                    Complex::from_polar(wave.power, TAU * phase.sum::<f64>())
                };
                let own = if i == j { noise * noise } else { 0.0 };
                aliases.iter().map(term).sum::<Complex<f64>>() + own
            })
        };
        let positions = positions(4);
        let inverse = covariance(&positions).try_inverse().unwrap();
        let [found, _] = information_traces(&aliases, &positions, noise);
        for axis in 0..2 {
            let mut trace = 0.0;
            for i in 0..positions.len() {
                let step = 1e-5;
                let moved = |by: f64| {
                    let mut positions = positions.clone();
                    positions[i][axis] += by;
                    covariance(&positions)
                };
                let change = (moved(step) - moved(-step)) / Complex::from(2.0 * step);
                trace += (&inverse * &change * &inverse * &change).trace().re;
            }
            assert!(
                (found[axis] / trace - 1.0).abs() < 1e-7,
                "{found:?}, {trace}"
            );
        }
    }

    /// White noise averaged over a pixel: `P = V sinc² sinc²`, V the variance of the wall's pixels
    /// over their number in a frame's pixel.
    #[test]
    fn spectrum_is_that_of_the_mean_over_a_pixel() {
        let (finer, sigma) = (4, 12.0);
        let side = UnknownTexture::min_side(finer);
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let half_width = f64::sqrt(3.0) * sigma;
        let value = |_| random.random_range(-half_width..half_width) as f32;
        let data = (0..6 * side * side).map(value).collect();
        let spectrum = WallSpectrum::of(&GreyImage::new(3 * side, 2 * side, data), finer);
        let near = |[s, h]: [usize; 2]| {
            // The mean over some frequencies, for the periodogram scatters.
            let around = (0..49).map(|k| (h + k / 7) * side + s + k % 7);
            around.map(|k| spectrum.density[k]).sum::<f64>() / 49.0
        };
        for [s, h] in [[5, 5], [40, 10], [side - 20, 30]] {
            let middle = |k: usize| signed(k + 3, side) as f64 / PATCH_PX as f64;
            let averaged = sinc(middle(s)) * sinc(middle(h));
            // A white wall pixel is not the mean of smaller ones.
            let whole = sinc(middle(s) / finer as f64) * sinc(middle(h) / finer as f64);
            let expected = (sigma * averaged / whole / finer as f64).powi(2);
            let found = near([s, h]);
            assert!(
                (found / expected - 1.0).abs() < 0.12,
                "{found} for {expected} at {s}, {h}"
            );
        }
    }

    /// The slopes are scaled by the roots of their shares, the features of exposure are not.
    #[test]
    fn slopes_are_scaled_by_the_root_of_their_share() {
        let texture = UnknownTexture {
            roots: vec![[0.5, 0.25], [0.8, 0.6]],
        };
        let mut features = Matrix4::repeat(1.0);
        texture.reduce_information(&mut features, 2);
        let roots = nalgebra::Vector4::new(0.5, 0.25, 1.0, 1.0);
        assert_eq!(features, roots * roots.transpose());
    }
}
