//! Roughness prior of the wall: weighted differences of fine pixels.

use crate::huber;
use std::f64::consts::PI;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// Number of fine pixels over which an edge is expected to continue along an axis.
const EDGE_LENGTH: usize = 6;

/// Differences of fine pixels, each as taps (column, row, factor).
///
/// They are `∂s`, `∂h`, `∂ss`, `∂hh`, `∂sh`, and the change of `∂h` along s and of `∂s` along h
/// over [`EDGE_LENGTH`] fine pixels.
const DIFFERENCES: [&[(usize, usize, f32)]; 7] = [
    &[(0, 0, -1.0), (1, 0, 1.0)],
    &[(0, 0, -1.0), (0, 1, 1.0)],
    &[(0, 0, 1.0), (1, 0, -2.0), (2, 0, 1.0)],
    &[(0, 0, 1.0), (0, 1, -2.0), (0, 2, 1.0)],
    &[(0, 0, 1.0), (1, 0, -1.0), (0, 1, -1.0), (1, 1, 1.0)],
    &[
        (0, 0, 1.0),
        (EDGE_LENGTH, 0, -1.0),
        (0, 1, -1.0),
        (EDGE_LENGTH, 1, 1.0),
    ],
    &[
        (0, 0, 1.0),
        (1, 0, -1.0),
        (0, EDGE_LENGTH, -1.0),
        (1, EDGE_LENGTH, 1.0),
    ],
];
/// Number of kinds of differences.
pub const KINDS: usize = DIFFERENCES.len();
/// Minimum weight of a difference.
const MIN_WEIGHT: f32 = 1e-4;
/// Number of frequencies along each axis at which spectra are sampled.
const FREQUENCIES_PER_AXIS: usize = 24;

/// Roughness of a raster, `Σ_i a_i Σ_n w_in (D_i x)_n²`: twice the negative logarithm of a Gaussian
/// prior.
///
/// Its spectrum is `1/P(f) = Σ_i a_i |D_i(f)|²`. First differences model the `1/f²` of natural
/// scenes, second differences the `1/f⁴` of smooth ones, and mixed differences walls with edges
/// along and across the tunnel. If grain hides an edge from its neighbouring pixels, the long
/// differences still constrain it: errors that are correlated along a course of bricks would bend
/// trajectories.
pub struct Roughness {
    columns: usize,
    rows: usize,
    /// Strengths `a`, grey levels⁻².
    pub strengths: [f64; KINDS],
    /// Weights `w` of each kind, at the first fine pixel of a difference; 0 if one is not seen.
    pub weights: [Vec<f32>; KINDS],
    /// Number of seen differences of each kind over the number of seen fine pixels.
    coverage: [f64; KINDS],
}

impl Roughness {
    /// Roughness of a raster with strengths 0; differences with unseen fine pixels do not count.
    pub fn new(columns: usize, rows: usize, seen: &[bool]) -> Self {
        let weights = DIFFERENCES.map(|taps| {
            let mut weights = vec![0.0; columns * rows];
            let [starts_s, starts_h] = start_counts(columns, rows, taps);
            for row in 0..starts_h {
                for column in 0..starts_s {
                    let at = row * columns + column;
                    let all = taps.iter().all(|(s, h, _)| seen[at + h * columns + s]);
                    weights[at] = if all { 1.0 } else { 0.0 };
                }
            }
            weights
        });
        let fine = seen.iter().filter(|seen| **seen).count().max(1) as f64;
        let coverage = std::array::from_fn(|kind: usize| {
            let known = weights[kind].iter().filter(|weight| **weight > 0.0);
            known.count() as f64 / fine
        });
        Self {
            columns,
            rows,
            strengths: [0.0; KINDS],
            weights,
            coverage,
        }
    }

    /// Sets `out` to `D_i x`, at the first fine pixel of each difference.
    fn apply_difference(&self, kind: usize, x: &[f32], out: &mut [f32]) {
        let taps = DIFFERENCES[kind];
        let [columns, rows] = start_counts(self.columns, self.rows, taps);
        out.fill(0.0);
        dispatch_simd(
            #[inline(always)]
            || {
                for row in 0..rows {
                    let start = row * self.columns;
                    for (s, h, factor) in taps {
                        let from = start + h * self.columns + s;
                        let source = &x[from..from + columns];
                        for (out, x) in out[start..start + columns].iter_mut().zip(source) {
                            *out += factor * x;
                        }
                    }
                }
            },
        );
    }

    /// Reweights each difference of x by Huber's loss, which preserves edges.
    ///
    /// The loss is linear beyond `limit` robust standard deviations of the kind.
    pub fn reweight(&mut self, x: &[f32], limit: f32) {
        let mut differences = vec![0.0; x.len()];
        for kind in 0..KINDS {
            self.apply_difference(kind, x, &mut differences);
            let weights = &mut self.weights[kind];
            let seen = differences.iter().zip(weights.iter());
            let sigma = huber::sigma(seen.filter(|(_, w)| **w > 0.0).map(|(d, _)| *d));
            for (w, d) in weights.iter_mut().zip(&differences) {
                if *w > 0.0 {
                    *w = huber::weight(*d, limit * sigma).max(MIN_WEIGHT);
                }
            }
        }
    }

    /// Computes `xᵀ D_iᵀ w_i D_i y` for each kind.
    pub fn products(&self, x: &[f32], y: &[f32]) -> [f64; KINDS] {
        let mut d_x = vec![0.0; x.len()];
        let mut d_y = vec![0.0; x.len()];
        std::array::from_fn(|kind| {
            self.apply_difference(kind, x, &mut d_x);
            self.apply_difference(kind, y, &mut d_y);
            let both = d_x.iter().zip(&d_y).zip(&self.weights[kind]);
            both.map(|((x, y), w)| f64::from(w * x * y)).sum()
        })
    }

    /// Adds `Σ_i a_i D_iᵀ w_i D_i x` to y; `scratch` has the raster's size.
    pub fn add_to(&self, x: &[f32], scratch: &mut [f32], y: &mut [f32]) {
        for (kind, taps) in DIFFERENCES.iter().enumerate() {
            self.apply_difference(kind, x, scratch);
            let strength = self.strengths[kind] as f32;
            let weights = &self.weights[kind];
            let [columns, rows] = start_counts(self.columns, self.rows, taps);
            dispatch_simd(
                #[inline(always)]
                || {
                    for (d, w) in scratch.iter_mut().zip(weights) {
                        *d *= strength * w;
                    }
                    for row in 0..rows {
                        let start = row * self.columns;
                        for (s, h, factor) in *taps {
                            let to = start + h * self.columns + s;
                            let target = &mut y[to..to + columns];
                            for (y, d) in target.iter_mut().zip(&scratch[start..start + columns]) {
                                *y += factor * d;
                            }
                        }
                    }
                },
            );
        }
    }

    /// Adds the diagonal of `Σ_i a_i D_iᵀ w_i D_i`.
    pub fn add_diagonal(&self, y: &mut [f32]) {
        for (kind, taps) in DIFFERENCES.iter().enumerate() {
            let strength = self.strengths[kind] as f32;
            for (at, w) in self.weights[kind].iter().enumerate() {
                if *w > 0.0 {
                    for (s, h, factor) in *taps {
                        y[at + h * self.columns + s] += strength * w * factor * factor;
                    }
                }
            }
        }
    }

    /// Mean over all frequencies of each kind's share of `1/P(f)`, reduced for kinds with unseen
    /// differences.
    pub fn shares(&self) -> [f64; KINDS] {
        let mut shares = [0.0; KINDS];
        let strengths = std::array::from_fn(|kind| self.coverage[kind] * self.strengths[kind]);
        for omega in frequencies() {
            let terms = spectrum_terms(&strengths, omega);
            let all: f64 = terms.iter().sum();
            for (share, part) in shares.iter_mut().zip(terms) {
                *share += part
                    / all.max(f64::MIN_POSITIVE)
                    / (FREQUENCIES_PER_AXIS * FREQUENCIES_PER_AXIS) as f64;
            }
        }
        shares
    }
}

/// Aliased variance (grey levels²) of a pixel as wide as `width` fine pixels.
///
/// It is `E_f[P(f) B(f)²]` over the frequencies above the pixel's Nyquist frequency along either
/// axis, on a wall of the given strengths, with `B(ω) = sin(ω width/2)/(width sin(ω/2))` along each
/// axis. Aliased texture appears at lower frequencies, differently in each frame.
pub fn aliased_variance(strengths: &[f64; KINDS], width: f64) -> f64 {
    let box_mean = |omega: f64| (0.5 * width * omega).sin() / (width * (0.5 * omega).sin());
    let finer = frequencies().filter(|omega| omega.iter().any(|omega| omega * width > PI));
    let variances = finer.map(|omega| {
        let all: f64 = spectrum_terms(strengths, omega).iter().sum();
        let seen = box_mean(omega[0]) * box_mean(omega[1]);
        seen * seen / all.max(f64::MIN_POSITIVE)
    });
    variances.sum::<f64>() / (FREQUENCIES_PER_AXIS * FREQUENCIES_PER_AXIS) as f64
}

/// Angular frequencies (s, h) spread evenly over a quarter of the spectrum, radians per pixel.
fn frequencies() -> impl Iterator<Item = [f64; 2]> {
    let at = |k: usize| ((k as f64 + 0.5) / FREQUENCIES_PER_AXIS as f64) * PI;
    (0..FREQUENCIES_PER_AXIS * FREQUENCIES_PER_AXIS)
        .map(move |k| [at(k / FREQUENCIES_PER_AXIS), at(k % FREQUENCIES_PER_AXIS)])
}

/// Computes the terms `a_i |D_i(f)|²` of `1/P(f)`.
fn spectrum_terms(strengths: &[f64; KINDS], omega: [f64; 2]) -> [f64; KINDS] {
    // |1 − exp(iωd)|² along s and h, for neighbours and for distant fine pixels.
    let squares = |apart: usize| omega.map(|omega| 2.0 - 2.0 * (apart as f64 * omega).cos());
    let ([s, h], [far_s, far_h]) = (squares(1), squares(EDGE_LENGTH));
    let responses = [s, h, s * s, h * h, s * h, far_s * h, s * far_h];
    std::array::from_fn(|kind| strengths[kind] * responses[kind])
}

/// Number of first columns and rows of a raster in which differences begin; 0 if none fits.
fn start_counts(columns: usize, rows: usize, taps: &[(usize, usize, f32)]) -> [usize; 2] {
    let reach = |along: fn(&(usize, usize, f32)) -> usize| taps.iter().map(along).max();
    let columns = columns.saturating_sub(reach(|tap| tap.0).unwrap_or(0));
    let rows = rows.saturating_sub(reach(|tap| tap.1).unwrap_or(0));
    if columns == 0 || rows == 0 {
        return [0, 0];
    }
    [columns, rows]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roughness() -> Roughness {
        let seen: Vec<bool> = (0..63).map(|k| k != 40).collect();
        let mut rough = Roughness::new(9, 7, &seen);
        rough.strengths = [1.0, 2.0, 0.5, 3.0, 0.25, 0.75, 1.5];
        rough
    }

    fn numbers(seed: f32) -> Vec<f32> {
        (0..63).map(|k| (12.9 * k as f32 + seed).sin()).collect()
    }

    #[test]
    fn the_matrix_is_that_of_the_quadratic_form_and_its_diagonal_is_its_own() {
        let rough = roughness();
        let (x, y) = (numbers(0.1), numbers(2.0));
        let times = |x: &[f32]| {
            let mut out = vec![0.0; 63];
            rough.add_to(x, &mut vec![0.0; 63], &mut out);
            out
        };
        let dot =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let products = rough.products(&x, &y);
        let form: f64 = products
            .iter()
            .zip(rough.strengths)
            .map(|(p, a)| a * p)
            .sum();
        assert!((dot(&y, &times(&x)) - form).abs() < 1e-4);
        let mut diagonal = vec![0.0; 63];
        rough.add_diagonal(&mut diagonal);
        for k in [0, 13, 31, 40, 62] {
            let unit: Vec<f32> = (0..63).map(|n| if n == k { 1.0 } else { 0.0 }).collect();
            assert!((times(&unit)[k] - diagonal[k]).abs() < 1e-5);
        }
        assert_eq!(diagonal[40], 0.0);
    }

    #[test]
    fn planes_and_edges_along_the_tunnel_have_no_energy_in_their_differences() {
        let rough = roughness();
        let plane: Vec<f32> = (0..63)
            .map(|k| (k % 9) as f32 - 2.0 * (k / 9) as f32)
            .collect();
        let edge: Vec<f32> = (0..63).map(|k| if k % 9 < 4 { 0.0 } else { 5.0 }).collect();
        assert!(
            rough.products(&plane, &plane)[2..]
                .iter()
                .all(|e| *e < 1e-6)
        );
        let energies = rough.products(&edge, &edge);
        assert!(energies[0] > 100.0 && energies[4] == 0.0);
        let mut soft = roughness();
        soft.reweight(&edge, 1.5);
        assert!(soft.products(&edge, &edge)[0] < 0.01 * energies[0]);
    }

    #[test]
    fn shares_add_up() {
        let rough = roughness();
        assert!((rough.shares().iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn kinds_without_seen_differences_have_no_share() {
        // Five of nine columns are seen.
        let seen: Vec<bool> = (0..63).map(|k| k % 9 < 5).collect();
        let mut rough = Roughness::new(9, 7, &seen);
        rough.strengths = [1.0; KINDS];
        let shares = rough.shares();
        assert_eq!(shares[5], 0.0);
        assert!(shares[..5].iter().all(|share| *share > 0.01), "{shares:?}");
        assert!(rough.weights[5].iter().all(|weight| *weight == 0.0));
        // A raster may be too narrow for the differences.
        let mut narrow = Roughness::new(3, 5, &[true; 15]);
        narrow.strengths = [1.0; KINDS];
        let mut y = vec![0.0; 15];
        narrow.add_to(&[1.0; 15], &mut [0.0; 15], &mut y);
        assert_eq!(y, [0.0; 15]);
    }

    /// The terms equal `|D_i(f)|²`, computed from the taps.
    #[test]
    fn parts_are_the_spectra_of_the_differences() {
        let omega = [0.7, 0.4];
        for (kind, (part, taps)) in spectrum_terms(&[1.0; KINDS], omega)
            .iter()
            .zip(DIFFERENCES)
            .enumerate()
        {
            let (mut re, mut im) = (0.0, 0.0);
            for (s, h, factor) in taps {
                let (sin, cos) = (*s as f64 * omega[0] + *h as f64 * omega[1]).sin_cos();
                re += f64::from(*factor) * cos;
                im += f64::from(*factor) * sin;
            }
            assert!((re * re + im * im - part).abs() < 1e-9, "{kind}");
        }
    }

    /// With only second differences, `1/P = a (s + h)²`, nearly all of the power is below the
    /// Nyquist frequency; not so for a wall with edges along and across.
    #[test]
    fn a_smooth_wall_hardly_aliases() {
        let of = |near: [f64; 5]| {
            let mut strengths = [0.0; KINDS];
            strengths[..5].copy_from_slice(&near);
            let power = frequencies()
                .map(|omega| 1.0 / spectrum_terms(&strengths, omega).iter().sum::<f64>());
            let power = power.sum::<f64>() / (FREQUENCIES_PER_AXIS * FREQUENCIES_PER_AXIS) as f64;
            aliased_variance(&strengths, 3.0) / power
        };
        let smooth = of([0.0, 0.0, 1.0, 1.0, 2.0]);
        let edges = of([0.01, 0.01, 0.0, 0.0, 0.2]);
        assert!(smooth > 0.0 && smooth < 0.001, "{smooth}");
        assert!(edges > 10.0 * smooth, "{edges} against {smooth}");
        // A pixel no wider than a fine one has nothing above its Nyquist frequency.
        assert_eq!(aliased_variance(&[1.0; KINDS], 1.0), 0.0);
    }
}
