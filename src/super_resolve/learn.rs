//! The most likely fine pixels, and how rough the wall is, learned from what frames show of them.

use super::footprints::Footprints;
use super::huber;
use super::observations::Reading;
use super::roughness::{KINDS, Roughness};
use super::solve::WallSolve;

/// Rounds of solving, weighing, and learning how rough the wall is.
const ROUNDS: usize = 4;
/// Steps of conjugate gradients a round.
const STEPS: usize = 10;
/// Huber's loss of a pixel is linear beyond so many σ.
const LIMIT: f32 = 2.0;
/// Least share of the residuals that is free of what was fitted to them.
const LEAST_FREE: f64 = 0.05;
/// Least share of the fine pixels that each kind of difference is learned from.
const LEAST_LEARNED: f64 = 1e-3;
/// Most that a round changes a strength by, up or down.
const MOST_CHANGE: f64 = 10.0;
/// Mean square of differences below which a wall has none, grey levels².
const SMOOTH: f64 = 1e-6;

/// What pixels say of how rough a wall is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Evidence {
    /// `γ_i`: degrees of freedom of the fine pixels that the pixels determine, of each kind of
    /// difference.
    freedoms: [f64; KINDS],
    /// `xᵀ D_iᵀ w_i D_i x`, grey levels².
    energies: [f64; KINDS],
}

impl Evidence {
    /// That of two regions.
    pub fn merge(self, other: &Self) -> Self {
        let sum = |a: [f64; KINDS], b: [f64; KINDS]| std::array::from_fn(|k| a[k] + b[k]);
        Self {
            freedoms: sum(self.freedoms, other.freedoms),
            energies: sum(self.energies, other.energies),
        }
    }

    /// The strengths `a_i = γ_i/(xᵀ D_iᵀ w_i D_i x)` under which the pixels are most likely, grey
    /// levels⁻²; 0 without evidence.
    pub fn strengths(&self) -> [f64; KINDS] {
        let ratio = |k: usize| self.freedoms[k] / self.energies[k].max(f64::MIN_POSITIVE);
        std::array::from_fn(ratio)
    }
}

/// A region of the wall, solved for.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// Its fine pixels, row-major; what no pixel shows is as it was.
    pub values: Vec<f32>,
    /// How rough it is.
    pub evidence: Evidence,
}

impl Footprints {
    /// The most likely fine pixels of the region, row-major, in one channel.
    ///
    /// `readings`: of the pixels of each view, in the order of [`Footprints::pixels`]. `start`: a
    /// panorama of the region, row-major, NaN in its holes; what no pixel shows stays as it is
    /// there.
    ///
    /// Each round improves x by conjugate gradients, then finds the strengths `a_i` of the
    /// roughness under which the pixels are most likely: of the fine pixels' n degrees of freedom
    ///
    /// ```text
    /// γ_i = n E_f[a_i |D_i(f)|² P(f)] − a_i tr(A⁻¹ D_iᵀ w_i D_i),    a_i = γ_i/(xᵀ D_iᵀ w_i D_i x)
    /// ```
    ///
    /// are determined by the pixels rather than by the prior and belong to kind i; A is the matrix
    /// of the normal equations, and the trace is taken with one vector of random signs.
    ///
    /// The same input gives the same numbers; nothing runs in parallel.
    ///
    /// Sources: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992; M. F.
    /// Hutchinson, "A stochastic estimator of the trace of the influence matrix", Communications in
    /// Statistics 18, 1989.
    ///
    /// # Panics
    /// As [`WallSolve::new`].
    pub fn super_resolve(&self, readings: &[Vec<Reading>], start: &[f32]) -> Resolved {
        let mut solve = WallSolve::new(self, readings, start, [0.0; KINDS]);
        let count = solve.seen.iter().filter(|seen| **seen).count() as f64;
        let observed = solve.observations.count() as f64;
        let mut evidence = Evidence::default();
        if count == 0.0 {
            return Resolved {
                values: start.to_vec(),
                evidence,
            };
        }
        let energies = solve.rough.products(&solve.x, &solve.x);
        solve.rough.strengths =
            energies.map(|energy| count / KINDS as f64 / energy.max(SMOOTH * count));
        let signs = signs(&solve.seen);
        let mut inverse_signs = vec![0.0; signs.len()];
        for round in 0..ROUNDS {
            solve.improve(STEPS);
            if round + 1 == ROUNDS {
                break;
            }
            solve.solve(&signs, STEPS, &mut inverse_signs);
            evidence = learn(&mut solve.rough, count, &solve.x, &signs, &inverse_signs);
            let determined: f64 = evidence.freedoms.iter().sum();
            let free = (1.0 - determined / observed).max(LEAST_FREE);
            weigh(&mut solve, free as f32);
            solve.weigh_edges();
        }
        let found = solve.x.iter().zip(&solve.seen).zip(start);
        let values = found.map(|((x, seen), start)| if *seen { *x } else { *start });
        Resolved {
            values: values.collect(),
            evidence,
        }
    }
}

/// Weighs each pixel by what it reads of x: `Ω = ω/(σ² v)` with Huber's weight ω for residuals
/// beyond [`LIMIT`] of their own robust standard deviation. v is what they say of the noise over
/// what was stated, if that is more than 1, where `free` is the share of the residuals that x is
/// not fitted to.
fn weigh(solve: &mut WallSolve, free: f32) {
    let residuals = solve.observations.residuals(&solve.x);
    let sigma = huber::sigma(solve.observations.known(&residuals)).max(free.sqrt());
    let inflation = sigma * sigma / free;
    let weight = |residual| huber::weight(residual, LIMIT * sigma) / inflation;
    solve.observations.weigh(&residuals, weight);
}

/// Sets the strengths to `γ_i/(xᵀ D_iᵀ w_i D_i x)`.
fn learn(
    rough: &mut Roughness,
    count: f64,
    x: &[f32],
    signs: &[f32],
    inverse_signs: &[f32],
) -> Evidence {
    let traces = rough.products(inverse_signs, signs);
    let shares = rough.shares();
    let freedoms = std::array::from_fn(|kind| {
        let gamma = shares[kind] * count - rough.strengths[kind] * traces[kind];
        gamma.max(LEAST_LEARNED * count)
    });
    let energies = rough
        .products(x, x)
        .map(|energy| energy.max(SMOOTH * count));
    let evidence = Evidence { freedoms, energies };
    for (strength, learned) in rough.strengths.iter_mut().zip(evidence.strengths()) {
        *strength = learned.clamp(*strength / MOST_CHANGE, *strength * MOST_CHANGE);
    }
    evidence
}

/// A random sign for each fine pixel that is seen, 0 elsewhere.
///
/// Source: the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number
/// generators", 2014).
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_together_are_as_rough_as_all_their_differences() {
        let of = |freedoms: f64, energy: f64| Evidence {
            freedoms: [freedoms; KINDS],
            energies: [energy; KINDS],
        };
        let both = of(10.0, 2.0).merge(&of(2.0, 4.0));
        assert_eq!(both.strengths(), [2.0; KINDS]);
        assert_eq!(Evidence::default().strengths(), [0.0; KINDS]);
    }
}
