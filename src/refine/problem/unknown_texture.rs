//! How much pixels tell of displacements where the texture is not known beforehand.
//!
//! Let the texture be a Gaussian process with the spectrum P, and let N frames with pixels' noise
//! σ² see it at the sub-pixel places x_i. What their pixels show at one frequency is the sum of all
//! frequencies g that look alike to them (aliasing), with the covariance
//!
//! `C = Σ_g P(g) a_g a_gᴴ + σ² I`,   `a_g = (exp(2πi g·x_i))_i`,
//!
//! and the texture has been integrated out of it. The Fisher information of the places along one
//! axis is `F_ij = tr(C⁻¹ ∂_iC C⁻¹ ∂_jC)`. With `∂_iC = e_i bᴴ + b e_iᴴ`,
//! `b_j = Σ_g −2πi g P(g) ā_gi a_gj` for j ≠ i, `b_i = 0` (the two halves of the diagonal cancel),
//! and `G = C⁻¹`,
//!
//! `F_ii = 2 G_ii bᴴGb + 2 Re (e_iᴴGb)²`.
//!
//! With the texture's slopes known it is `J_ii = 2 Σ_g (2πg)² P(g)/σ² (1 − 1/N)`. On average over
//! all places both matrices are multiples of `I − 11ᵀ/N`: they are alike in all frames, and what
//! moves all of them together tells nothing. So the share `tr F / tr J` of the information is left,
//! and slopes count by its root.
//!
//! Without aliases the share of a frequency is `Nρ/(1 + Nρ)`, `ρ = P/σ²`: detail below the noise of
//! the mean of all frames is of no use. With them it stays below 1 however little noise there is:
//! how much looks like something coarser must be told from the same pixels, which takes as many
//! frames as there are frequencies that look alike.
//!
//! Source: W. J. Bangs, "Array processing with generalized beamformers", thesis, Yale, 1971; W. R.
//! Hahn and S. A. Tretter, "Optimum processing for delay-vector estimation in passive signal
//! arrays", IEEE Transactions on Information Theory 19(5), 1973; P. Stoica and A. Nehorai,
//! "Performance study of conditional and unconditional direction-of-arrival estimation", IEEE
//! Transactions on Acoustics, Speech, and Signal Processing 38(10), 1990 (that the bound with a
//! known texture is not to be reached, however much data there is, and this one is).

use crate::frames::GreyImage;
use crate::numerics::signal::{hann, sinc};
use crate::numerics::spectrum::Transform;
use nalgebra::{Complex, DMatrix, DVector, Matrix4};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Side of the patches whose spectra are averaged, pixels of a frame.
const PATCH_PX: usize = 64;
/// Frequencies that are drawn, and sets of places for each.
const FREQUENCIES: usize = 800;
const PLACES: usize = 4;
/// Frames that see a point, at the most; beyond, little changes.
const MOST_FRAMES: usize = 24;

/// Shares of the information of displacements, by the number of frames that see a point of the
/// wall.
#[derive(Clone, Debug)]
pub struct UnknownTexture {
    /// Roots of the shares along s and h for two frames, three, …
    roots: Vec<[f64; 2]>,
}

impl UnknownTexture {
    /// For the wall shown by `wall` (columns along s, rows along h, at least
    /// [`UnknownTexture::least_side`] of each), `finer` times as fine as pixels of a frame, with
    /// noise of `noise_grey` grey levels (1-σ) in these.
    pub fn of_wall(wall: &GreyImage, finer: usize, noise_grey: f64) -> Self {
        let spectrum = WallSpectrum::of(wall, finer);
        let shares = (2..=MOST_FRAMES).into_par_iter();
        let shares = shares.map(|frames| spectrum.shares(frames, noise_grey));
        Self {
            roots: shares.map(|share| share.map(f64::sqrt)).collect(),
        }
    }

    /// Rows and columns that a wall `finer` times as fine as pixels must have.
    pub fn least_side(finer: usize) -> usize {
        PATCH_PX * finer
    }

    /// Takes from `M = Σ p φ φᵀ` of a tile that `frames` frames see what needs a known texture.
    pub fn weaken(&self, features: &mut Matrix4<f64>, frames: usize) {
        let Some(root) = self.roots.get(frames.clamp(2, MOST_FRAMES) - 2) else {
            return;
        };
        for (k, root) in root.iter().enumerate() {
            features.row_mut(k).scale_mut(*root);
            features.column_mut(k).scale_mut(*root);
        }
    }
}

/// Power spectral density of what a frame's pixels see, (grey level)² px².
struct WallSpectrum {
    /// At `(k_h, k_s)/`[`PATCH_PX`] cycles/px, row-major with negative frequencies last.
    density: Vec<f64>,
    side: usize,
    finer: usize,
}

impl WallSpectrum {
    /// The mean of the periodograms of patches that overlap by half, under Hann's window (Welch's
    /// method).
    fn of(wall: &GreyImage, finer: usize) -> Self {
        let side = UnknownTexture::least_side(finer);
        let transform = Transform::at_least(side, side);
        let hann = |k: usize| hann(k, side);
        let energy: f64 = (0..side).map(|k| hann(k).powi(2)).sum();
        let starts = |length: usize| (0..=length - side).step_by(side / 2);
        let places: Vec<(usize, usize)> = starts(wall.height())
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
        // In order, so that the sum is the same whatever the number of threads.
        let mut half = vec![0.0; width * side];
        for run in places.chunks(64) {
            let squares: Vec<Vec<f64>> = run.par_iter().map(periodogram).collect();
            half = squares.into_iter().fold(half, add);
        }
        let scale = 1.0 / (places.len() as f64 * energy * energy * (finer * finer) as f64);
        // Pixels average over their square; the wall's are themselves the mean of smaller ones.
        let smoothing = |k: usize| {
            let frequency = signed(k, side) as f64 / PATCH_PX as f64;
            (sinc(frequency) / sinc(frequency / finer as f64)).powi(2)
        };
        let density = (0..side * side).map(|k| {
            let (column, row) = (k % side, k / side);
            // The spectrum of a real raster is that of its mirror image in the origin.
            let square = if column < width {
                half[row * width + column]
            } else {
                half[(side - row) % side * width + side - column]
            };
            scale * square * smoothing(column) * smoothing(row)
        });
        Self {
            density: density.collect(),
            side,
            finer,
        }
    }

    /// `tr F / tr J` along s and h for `frames` frames, over frequencies and places drawn at
    /// random, always the same ones.
    fn shares(&self, frames: usize, noise_grey: f64) -> [f64; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(frames as u64);
        let half = (PATCH_PX / 2) as i64;
        let (mut found, mut known) = ([0.0; 2], [0.0; 2]);
        for _ in 0..FREQUENCIES {
            let base = [(); 2].map(|()| random.random_range(-half..half));
            let alike = self.alike(base);
            for _ in 0..PLACES {
                let places = (0..frames).map(|_| [random.random(), random.random()]);
                let places: Vec<[f64; 2]> = places.collect();
                let [own, all] = informations(&alike, &places, noise_grey);
                for axis in 0..2 {
                    found[axis] += own[axis];
                    known[axis] += all[axis];
                }
            }
        }
        [0, 1].map(|axis| (found[axis] / known[axis]).min(1.0))
    }

    /// The frequencies that look like `base`/[`PATCH_PX`] to pixels, itself among them.
    fn alike(&self, base: [i64; 2]) -> Vec<Wave> {
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

/// A frequency of the texture.
struct Wave {
    /// Along s and h, cycles/px.
    frequency: [f64; 2],
    /// P.
    power: f64,
}

/// `tr F` and `tr J` along each axis for frames at the given `places` (pixels along s and h).
fn informations(alike: &[Wave], places: &[[f64; 2]], noise_grey: f64) -> [[f64; 2]; 2] {
    let n = places.len();
    let noise = noise_grey.powi(2);
    let seen = DMatrix::from_fn(n, alike.len(), |i, g| {
        let [s, h] = alike[g].frequency;
        Complex::from_polar(1.0, TAU * (s * places[i][0] + h * places[i][1]))
    });
    let weighed = |weight: &dyn Fn(&Wave) -> Complex<f64>| {
        let weights = alike.iter().map(weight);
        let weights = DVector::from_iterator(alike.len(), weights);
        &seen * DMatrix::from_diagonal(&weights) * seen.adjoint()
    };
    let mut covariance = weighed(&|wave| wave.power.into());
    for i in 0..n {
        covariance[(i, i)] += noise;
    }
    // Hermitian and at least σ² I.
    let Some(factor) = covariance.cholesky() else {
        return [[0.0; 2]; 2];
    };
    let inverse = factor.inverse();
    let of_axis = |axis: usize| {
        let slope = |wave: &Wave| TAU * wave.frequency[axis];
        let changes = weighed(&|wave| Complex::new(0.0, -slope(wave) * wave.power));
        let of_place = |i: usize| {
            let mut b = changes.column(i).into_owned();
            b[i] = Complex::ZERO;
            let gb = &inverse * &b;
            2.0 * (inverse[(i, i)].re * b.dotc(&gb).re + (gb[i] * gb[i]).re)
        };
        let steepness = alike.iter().map(|wave| slope(wave).powi(2) * wave.power);
        let known = 2.0 * (n as f64 - 1.0) * steepness.sum::<f64>() / noise;
        ((0..n).map(of_place).sum(), known)
    };
    let [s, h]: [(f64, f64); 2] = [0, 1].map(of_axis);
    [[s.0, h.0], [s.1, h.1]]
}

/// `k` of a transform of `side` values as a frequency of either sign.
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

    fn places(count: usize) -> Vec<[f64; 2]> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let places = (0..count).map(|_| [random.random(), random.random()]);
        places.collect()
    }

    /// Bangs's closed form for one frequency: `F/J = Nρ/(1 + Nρ)`.
    #[test]
    fn without_aliases_detail_below_the_noise_of_the_mean_is_lost() {
        for (count, power, noise) in [(2, 3.0, 1.0), (5, 0.1, 2.0), (9, 40.0, 0.5)] {
            let [found, known] = informations(&[wave([0.2, -0.3], power)], &places(count), noise);
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

    /// `F_ii = tr(C⁻¹ ∂_iC C⁻¹ ∂_iC)` as it stands, with ∂_iC by central differences.
    #[test]
    fn information_is_that_of_the_covariance() {
        let alike = [
            wave([0.2, -0.3], 3.0),
            wave([-0.8, -0.3], 0.7),
            wave([0.2, 0.7], 0.4),
            wave([-0.8, 0.7], 0.2),
        ];
        let noise = 0.8;
        let covariance = |places: &[[f64; 2]]| {
            DMatrix::from_fn(places.len(), places.len(), |i, j| {
                let term = |wave: &Wave| {
                    let phase = (0..2).map(|k| wave.frequency[k] * (places[i][k] - places[j][k]));
                    Complex::from_polar(wave.power, TAU * phase.sum::<f64>())
                };
                let own = if i == j { noise * noise } else { 0.0 };
                alike.iter().map(term).sum::<Complex<f64>>() + own
            })
        };
        let places = places(4);
        let inverse = covariance(&places).try_inverse().unwrap();
        let [found, _] = informations(&alike, &places, noise);
        for axis in 0..2 {
            let mut trace = 0.0;
            for i in 0..places.len() {
                let step = 1e-5;
                let moved = |by: f64| {
                    let mut places = places.clone();
                    places[i][axis] += by;
                    covariance(&places)
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

    /// White noise through a pixel: `P = V sinc² sinc²`, V the variance of the wall's pixels over
    /// their number in one.
    #[test]
    fn the_spectrum_is_that_of_what_pixels_see() {
        let (finer, sigma) = (4, 12.0);
        let side = UnknownTexture::least_side(finer);
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
            let seen = sinc(middle(s)) * sinc(middle(h));
            // A white wall pixel is not the mean of smaller ones.
            let whole = sinc(middle(s) / finer as f64) * sinc(middle(h) / finer as f64);
            let expected = (sigma * seen / whole / finer as f64).powi(2);
            let found = near([s, h]);
            assert!(
                (found / expected - 1.0).abs() < 0.12,
                "{found} for {expected} at {s}, {h}"
            );
        }
    }

    /// Features of displacements lose their share, those of exposure none.
    #[test]
    fn slopes_are_weakened_by_the_root_of_their_share() {
        let texture = UnknownTexture {
            roots: vec![[0.5, 0.25], [0.8, 0.6]],
        };
        let mut features = Matrix4::repeat(1.0);
        texture.weaken(&mut features, 2);
        let roots = nalgebra::Vector4::new(0.5, 0.25, 1.0, 1.0);
        assert_eq!(features, roots * roots.transpose());
    }
}
