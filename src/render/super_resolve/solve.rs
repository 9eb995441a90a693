//! The most likely fine pixels, given what frames show of them.

use super::conjugate_gradients::conjugate_gradients;
use super::footprints::Footprints;
use super::observations::{Channel, Observations};
use super::roughness::{KINDS, Roughness};

/// Fine pixels on every side of a tile that its region should reach beyond it.
pub const MARGIN: usize = 8;
/// Rounds of solving, weighing, and learning how rough the wall is.
const ROUNDS: usize = 4;
/// Steps of conjugate gradients a round.
const STEPS: usize = 10;
/// Huber's losses are linear beyond so many σ: of pixels and of differences.
const LIMITS: [f32; 2] = [2.0, 1.5];
/// Least share of the residuals that is free of what was fitted to them.
const LEAST_FREE: f64 = 0.05;
/// Least share of the fine pixels that each kind of difference is learned from.
const LEAST_LEARNED: f64 = 1e-3;
/// Most that a round changes a strength by, up or down.
const MOST_CHANGE: f64 = 10.0;
/// Mean square of differences below which a wall has none, grey levels².
const SMOOTH: f64 = 1e-6;

impl Footprints {
    /// The most likely fine pixels of the region, row-major, for one channel.
    ///
    /// `channels`: that of each view's frame, in the order the views were given in. `start`: a panorama of the region,
    /// row-major, NaN in its holes; what no pixel shows stays as it is there.
    ///
    /// Each round improves x by conjugate gradients, then finds the strengths `a_i` of the roughness under which the
    /// pixels are most likely: of the fine pixels' n degrees of freedom
    ///
    /// ```text
    /// γ_i = n E_f[a_i |D_i(f)|² P(f)] − a_i tr(A⁻¹ D_iᵀ w_i D_i),    a_i = γ_i/(xᵀ D_iᵀ w_i D_i x)
    /// ```
    ///
    /// are determined by the pixels rather than by the prior and belong to kind i; A is the matrix of the normal equations,
    /// and the trace is taken with one vector of random signs.
    ///
    /// The same input gives the same numbers; nothing runs in parallel.
    ///
    /// Sources: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992; M. F. Hutchinson, "A stochastic
    /// estimator of the trace of the influence matrix", Communications in Statistics 18, 1989.
    ///
    /// # Panics
    /// If `start` has not the region's size, or a channel has fewer pixels than its camera.
    pub fn super_resolve(&self, channels: &[Channel], start: &[f32]) -> Vec<f32> {
        let region = self.region;
        assert_eq!(start.len(), region.pixels(), "fine pixels to start from");
        let mut observations = Observations::new(self, channels);
        let seen = observations.seen();
        let count = seen.iter().filter(|seen| **seen).count() as f64;
        let observed = observations.count() as f64;
        if count == 0.0 {
            return start.to_vec();
        }
        let mut x = without_holes(start);
        let mut rough = Roughness::new(region.columns, region.rows, &seen);
        let energies = rough.products(&x, &x);
        rough.strengths = energies.map(|energy| count / KINDS as f64 / energy.max(SMOOTH * count));
        let signs = signs(&seen);
        let mut inverse_signs = vec![0.0; x.len()];
        for round in 0..ROUNDS {
            let system = System::new(&observations, &rough);
            system.improve(&observations.right(), &mut x);
            if round + 1 == ROUNDS {
                break;
            }
            system.improve(&signs, &mut inverse_signs);
            let determined = learn(&mut rough, count, &x, &signs, &inverse_signs);
            let free = (1.0 - determined / observed).max(LEAST_FREE);
            observations.weigh(&x, free as f32, LIMITS[0]);
            rough.weigh(&x, LIMITS[1]);
        }
        let found = x.iter().zip(&seen).zip(start);
        found
            .map(|((x, seen), start)| if *seen { *x } else { *start })
            .collect()
    }
}

/// The normal equations of one round.
struct System<'a> {
    observations: &'a Observations<'a>,
    rough: &'a Roughness,
    diagonal: Vec<f32>,
}

impl<'a> System<'a> {
    fn new(observations: &'a Observations<'a>, rough: &'a Roughness) -> Self {
        let mut diagonal = vec![0.0; rough.pixels()];
        observations.add_diagonal(&mut diagonal);
        rough.add_diagonal(&mut diagonal);
        Self {
            observations,
            rough,
            diagonal,
        }
    }

    /// Brings x closer to `A⁻¹ right`.
    fn improve(&self, right: &[f32], x: &mut [f32]) {
        let mut scratch = vec![0.0; x.len()];
        let times = |x: &[f32], y: &mut [f32]| {
            y.fill(0.0);
            self.observations.add_to(x, y);
            self.rough.add_to(x, &mut scratch, y);
        };
        conjugate_gradients(times, &self.diagonal, right, STEPS, x);
    }
}

/// Sets the strengths to `γ_i/(xᵀ D_iᵀ w_i D_i x)`; `Σ γ_i`.
fn learn(
    rough: &mut Roughness,
    count: f64,
    x: &[f32],
    signs: &[f32],
    inverse_signs: &[f32],
) -> f64 {
    let energies = rough.products(x, x);
    let traces = rough.products(inverse_signs, signs);
    let shares = rough.shares();
    let mut determined = 0.0;
    for kind in 0..KINDS {
        let strength = rough.strengths[kind];
        let gamma = shares[kind] * count - strength * traces[kind];
        let gamma = gamma.max(LEAST_LEARNED * count);
        determined += gamma;
        rough.strengths[kind] = (gamma / energies[kind].max(SMOOTH * count))
            .clamp(strength / MOST_CHANGE, strength * MOST_CHANGE);
    }
    determined
}

/// The panorama with the mean of what is known in its holes.
fn without_holes(start: &[f32]) -> Vec<f32> {
    let known = || start.iter().copied().filter(|v| v.is_finite());
    let mean = known().sum::<f32>() / known().count().max(1) as f32;
    start
        .iter()
        .map(|v| if v.is_finite() { *v } else { mean })
        .collect()
}

/// A random sign for each fine pixel that is seen, 0 elsewhere.
///
/// Source: the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
fn signs(seen: &[bool]) -> Vec<f32> {
    let sign = |k: u64| {
        let mut z = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
    };
    (0..)
        .zip(seen)
        .map(|(k, seen)| if *seen { sign(k) } else { 0.0 })
        .collect()
}
