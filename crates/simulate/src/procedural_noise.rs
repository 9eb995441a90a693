//! Procedural noise: random numbers that depend only on a seed, a position and a frame.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Hashes three integers to 64 well-mixed bits.
///
/// Source: the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number
/// generators", 2014).
fn hash(seed: u64, i: i64, j: i64) -> u64 {
    let mut z = seed
        .wrapping_add((i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15))
        .wrapping_add((j as u64).wrapping_mul(0xd1b5_4a32_d192_ed03));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Uniform number in `[0, 1)` of the lattice point `(i, j)`.
pub(super) fn uniform(seed: u64, i: i64, j: i64) -> f32 {
    (hash(seed, i, j) >> 40) as f32 / (1u64 << 24) as f32
}

/// Standard normal number of the lattice point `(i, j)`.
///
/// Source: G. E. P. Box, M. E. Muller, "A note on the generation of random normal deviates", 1958.
pub(super) fn normal(seed: u64, i: i64, j: i64) -> f64 {
    let [u, v] = [0, 1].map(|stream| f64::from(uniform(derived_seed(seed, stream), i, j)));
    (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
}

/// Derives the seed of an independent random stream.
pub(super) fn derived_seed(seed: u64, stream: i64) -> u64 {
    hash(seed, stream, -1)
}

/// Independent random streams of a simulation.
///
/// Pose jitter and sensor noise draw from the seed itself.
#[derive(Clone, Copy, Debug)]
pub(super) enum RandomStream {
    /// Texture of the wall.
    WallTexture,
    /// Gain and bias of the frames.
    Exposure,
    /// Wet patches and the ripples of their water.
    WetPatches,
    /// Objects between camera and wall.
    MovingObjects,
    /// Blur and occlusion of bad frames.
    BadFrames,
    /// Ovality and undulation of the lining.
    Lining,
    /// Steps of the lining's segments.
    Segments,
    /// Places and looks of cables and lamps.
    Fittings,
    /// Phases of the flicker.
    Flicker,
    /// Steps of the exposure.
    ExposureSteps,
    /// Specks on the lens.
    LensDust,
    /// Directions of motion blur.
    MotionBlur,
}

impl RandomStream {
    /// Seed of this stream.
    pub fn seed(self, seed: u64) -> u64 {
        derived_seed(seed, self as i64)
    }

    /// Random generator of this stream for one frame.
    pub fn rng(self, seed: u64, frame: usize) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed(seed));
        rng.set_stream(frame as u64);
        rng
    }
}

/// Value noise: uniform numbers on a lattice of the wall, interpolated by `3t² − 2t³`.
#[derive(Clone, Copy, Debug)]
pub(super) struct ValueNoise {
    /// Seed of the lattice's numbers.
    pub seed: u64,
    /// Maximum absolute value, grey levels.
    pub amplitude: f32,
    /// Size of a lattice cell along s and h, metres.
    pub cell_m: [f64; 2],
    /// Period of the lattice along s, cells: at most once around.
    pub period_s: i64,
    /// Period of the lattice along h, cells, if it repeats.
    pub period_h: Option<i64>,
}

impl ValueNoise {
    /// Noise with cells of about `cell_m` that does not repeat along h.
    ///
    /// It repeats after `repeat_m` along s, which must divide the perimeter.
    pub fn unique(seed: u64, amplitude: f32, cell_m: f64, repeat_m: f64) -> Self {
        let period_s = (repeat_m / cell_m).round().max(1.0);
        Self {
            seed,
            amplitude,
            cell_m: [repeat_m / period_s, cell_m],
            period_s: period_s as i64,
            period_h: None,
        }
    }

    /// Makes the noise repeat along h after `repeat_h_m` as well.
    pub fn repeating(self, repeat_h_m: f64) -> Self {
        let period_h = (repeat_h_m / self.cell_m[1]).round().max(1.0);
        Self {
            cell_m: [self.cell_m[0], repeat_h_m / period_h],
            period_h: Some(period_h as i64),
            ..self
        }
    }

    /// The noise at a point of the plane, grey levels.
    pub fn at(&self, s_m: f64, h_m: f64) -> f32 {
        let (x, y) = (s_m / self.cell_m[0], h_m / self.cell_m[1]);
        let (i, j) = (x.floor(), y.floor());
        let [fx, fy] = [x - i, y - j].map(|share| smoothstep(share as f32));
        let (i, j) = (i as i64, j as i64);
        let row = |j: i64| self.period_h.map_or(j, |period| j.rem_euclid(period));
        let node = |i: i64, j: i64| uniform(self.seed, i.rem_euclid(self.period_s), row(j));
        let along = |j: i64| node(i, j) + (node(i + 1, j) - node(i, j)) * fx;
        let (a, b) = (along(j), along(j + 1));
        self.amplitude * (2.0 * (a + (b - a) * fy) - 1.0)
    }

    /// Adds the noise at chainage `h_m` to the row of texels at `s = (k + ½) texel_m`.
    pub fn add_to_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
        let y = h_m / self.cell_m[1];
        let (j, t) = (y.floor() as i64, smoothstep((y - y.floor()) as f32));
        let lattice_row = |j: i64| self.period_h.map_or(j, |period| j.rem_euclid(period));
        let (above, below) = (lattice_row(j), lattice_row(j + 1));
        let nodes: Vec<f32> = (0..=self.period_s)
            .map(|i| {
                let i = i % self.period_s;
                let (a, b) = (uniform(self.seed, i, above), uniform(self.seed, i, below));
                self.amplitude * (2.0 * (a + (b - a) * t) - 1.0)
            })
            .collect();
        let step = texel_m / self.cell_m[0];
        for (k, value) in row.iter_mut().enumerate() {
            let x = (k as f64 + 0.5) * step;
            let cell = x as usize;
            let i = cell % self.period_s as usize;
            let (a, b) = (nodes[i], nodes[i + 1]);
            *value += a + (b - a) * smoothstep((x - cell as f64) as f32);
        }
    }
}

/// Smoothstep, `3t² − 2t³`.
fn smoothstep(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_numbers_are_uniform_and_unlike_their_neighbours() {
        let n = 200i64;
        let value = |k: i64| f64::from(uniform(5, k % n, k / n));
        let mean = (0..n * n).map(value).sum::<f64>() / (n * n) as f64;
        let variance = (0..n * n).map(|k| (value(k) - mean).powi(2)).sum::<f64>() / (n * n) as f64;
        assert!((mean - 0.5).abs() < 0.005 && (variance - 1.0 / 12.0).abs() < 0.002);
        for stride in [1, n] {
            let covariance = (0..n * (n - 1))
                .map(|k| (value(k) - mean) * (value(k + stride) - mean))
                .sum::<f64>()
                / (n * n) as f64;
            assert!(covariance.abs() < 0.002, "{stride}: {covariance}");
        }
    }

    #[test]
    fn noise_at_a_point_is_that_of_a_row() {
        let noise = ValueNoise::unique(3, 5.0, 0.04, 0.5);
        let mut row = vec![0.0; 100];
        noise.add_to_row(0.333, 0.005, &mut row);
        for (k, value) in row.iter().enumerate() {
            let at = noise.at((k as f64 + 0.5) * 0.005, 0.333);
            assert!((at - value).abs() < 1e-4);
        }
    }

    #[test]
    fn noise_repeats_after_its_periods_and_not_before() {
        let repeat_m = 0.5;
        let row = |noise: ValueNoise, h_m: f64| {
            let mut row = vec![0.0; 200];
            noise.add_to_row(h_m, 0.005, &mut row);
            row
        };
        let unique = ValueNoise::unique(3, 1.0, 0.04, repeat_m);
        let first = row(unique, 0.333);
        for k in 0..100 {
            assert!((first[k] - first[k + 100]).abs() < 1e-5);
        }
        assert!((0..50).any(|k| (first[k] - first[k + 50]).abs() > 0.1));
        let (tiled, again) = (unique.repeating(0.25), 0.333 + 3.0 * 0.25);
        let alike = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(alike(&row(tiled, 0.333), &row(tiled, again)));
        assert!(!alike(&first, &row(unique, again)));
    }
}
