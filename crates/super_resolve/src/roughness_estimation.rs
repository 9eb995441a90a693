//! Joint estimation of fine pixels and roughness by evidence maximisation.

use crate::footprints::Footprints;
use crate::huber;
use crate::reading::Reading;
use crate::roughness::{KINDS, Roughness};
use crate::wall_solve::WallSolve;

/// Iterations of solving, reweighting and roughness estimation.
pub const MAX_REWEIGHTING_ITERATIONS: usize = 4;
/// Iterations of conjugate gradients per solve.
pub const MAX_CG_ITERATIONS: usize = 10;
/// Residual of a pixel, in σ, beyond which Huber's loss is linear.
pub const HUBER_LIMIT_SIGMAS: f32 = 2.0;
/// Minimum share of the residuals' degrees of freedom that is not fitted.
const MIN_FREE_SHARE: f64 = 0.05;
/// Minimum degrees of freedom of each kind of difference, as a share of the fine pixels.
const MIN_FREEDOM_SHARE: f64 = 1e-3;
/// Maximum factor by which an iteration changes a strength.
const MAX_STRENGTH_CHANGE: f64 = 10.0;
/// Minimum mean square of differences, grey levels²; a smoother wall counts as this smooth.
const MIN_MEAN_SQUARE: f64 = 1e-6;

/// Evidence of pixels for the roughness of a wall.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoughnessEvidence {
    /// Degrees of freedom `γ_i` of each kind of difference that the pixels determine.
    freedoms: [f64; KINDS],
    /// Energies `xᵀ D_iᵀ w_i D_i x`, grey levels².
    energies: [f64; KINDS],
}

impl RoughnessEvidence {
    /// Combines the evidence of two regions.
    pub fn merge(self, other: &Self) -> Self {
        let sum = |a: [f64; KINDS], b: [f64; KINDS]| std::array::from_fn(|k| a[k] + b[k]);
        Self {
            freedoms: sum(self.freedoms, other.freedoms),
            energies: sum(self.energies, other.energies),
        }
    }

    /// Most likely strengths `a_i = γ_i/(xᵀ D_iᵀ w_i D_i x)`, grey levels⁻²; 0 without evidence.
    pub fn strengths(&self) -> [f64; KINDS] {
        let ratio = |k: usize| self.freedoms[k] / self.energies[k].max(f64::MIN_POSITIVE);
        std::array::from_fn(ratio)
    }
}

/// Super-resolved region of the wall.
#[derive(Clone, Debug)]
pub struct SolvedRegion {
    /// Fine pixels, row-major; unseen ones keep their initial values.
    pub values: Vec<f32>,
    /// Evidence for the roughness of the region.
    pub evidence: RoughnessEvidence,
}

impl Footprints {
    /// Estimates the most likely fine pixels of the region, row-major, in one channel.
    ///
    /// `readings`: those of each view's pixels, in the order of [`Footprints::pixels`]. `start`: a
    /// panorama of the region, row-major, NaN in its holes; unseen fine pixels keep its values.
    ///
    /// Each iteration improves x by conjugate gradients, then updates the strengths `a_i` of the
    /// roughness to maximise the evidence. Of the fine pixels' n degrees of freedom
    ///
    /// ```text
    /// γ_i = n E_f[a_i |D_i(f)|² P(f)] − a_i tr(A⁻¹ D_iᵀ w_i D_i),    a_i = γ_i/(xᵀ D_iᵀ w_i D_i x)
    /// ```
    ///
    /// are determined by the pixels rather than by the prior and belong to kind i. A is the matrix
    /// of the normal equations, and the trace is estimated with one vector of random signs.
    ///
    /// The result is deterministic; nothing runs in parallel.
    ///
    /// Sources: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992; M. F.
    /// Hutchinson, "A stochastic estimator of the trace of the influence matrix", Communications in
    /// Statistics 18, 1989.
    ///
    /// # Panics
    /// If the sizes of `start` or `readings` do not match ([`WallSolve::new`]).
    pub fn super_resolve(&self, readings: &[Vec<Reading>], start: &[f32]) -> SolvedRegion {
        let mut solve = WallSolve::new(self, readings, start, [0.0; KINDS]);
        let count = solve.seen.iter().filter(|seen| **seen).count() as f64;
        let observed = solve.observations.count() as f64;
        let mut evidence = RoughnessEvidence::default();
        if count == 0.0 {
            return SolvedRegion {
                values: start.to_vec(),
                evidence,
            };
        }
        let energies = solve.rough.products(&solve.x, &solve.x);
        solve.rough.strengths =
            energies.map(|energy| count / KINDS as f64 / energy.max(MIN_MEAN_SQUARE * count));
        let signs = random_signs(&solve.seen);
        let mut inverse_signs = vec![0.0; signs.len()];
        for round in 0..MAX_REWEIGHTING_ITERATIONS {
            solve.improve(MAX_CG_ITERATIONS);
            if round + 1 == MAX_REWEIGHTING_ITERATIONS {
                break;
            }
            solve.solve(&signs, MAX_CG_ITERATIONS, &mut inverse_signs);
            evidence = update_strengths(&mut solve.rough, count, &solve.x, &signs, &inverse_signs);
            let determined: f64 = evidence.freedoms.iter().sum();
            let free = (1.0 - determined / observed).max(MIN_FREE_SHARE);
            reweight_pixels(&mut solve, free as f32);
            solve.reweight_edges();
        }
        let found = solve.x.iter().zip(&solve.seen).zip(start);
        let values = found.map(|((x, seen), start)| if *seen { *x } else { *start });
        SolvedRegion {
            values: values.collect(),
            evidence,
        }
    }
}

/// Reweights each pixel by its residual: `Ω = ω/(σ² v)`, with Huber's weight ω.
///
/// The limit is [`HUBER_LIMIT_SIGMAS`] robust standard deviations of the residuals. v is the ratio
/// of the observed to the stated variance, at least 1; `free` is the share of the residuals'
/// degrees of freedom that is not fitted.
fn reweight_pixels(solve: &mut WallSolve, free: f32) {
    let residuals = solve.observations.residuals(&solve.x);
    let sigma = huber::sigma(solve.observations.valid(&residuals)).max(free.sqrt());
    let inflation = sigma * sigma / free;
    let weight = |residual| huber::weight(residual, HUBER_LIMIT_SIGMAS * sigma) / inflation;
    solve.observations.reweight(&residuals, weight);
}

/// Updates the strengths to `γ_i/(xᵀ D_iᵀ w_i D_i x)`.
fn update_strengths(
    rough: &mut Roughness,
    count: f64,
    x: &[f32],
    signs: &[f32],
    inverse_signs: &[f32],
) -> RoughnessEvidence {
    let traces = rough.products(inverse_signs, signs);
    let shares = rough.shares();
    let freedoms = std::array::from_fn(|kind| {
        let gamma = shares[kind] * count - rough.strengths[kind] * traces[kind];
        gamma.max(MIN_FREEDOM_SHARE * count)
    });
    let energies = rough
        .products(x, x)
        .map(|energy| energy.max(MIN_MEAN_SQUARE * count));
    let evidence = RoughnessEvidence { freedoms, energies };
    for (strength, learned) in rough.strengths.iter_mut().zip(evidence.strengths()) {
        *strength = learned.clamp(
            *strength / MAX_STRENGTH_CHANGE,
            *strength * MAX_STRENGTH_CHANGE,
        );
    }
    evidence
}

/// Random sign of each seen fine pixel, 0 elsewhere.
///
/// Source: the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number
/// generators", 2014).
fn random_signs(seen: &[bool]) -> Vec<f32> {
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
    fn merged_evidence_is_that_of_all_differences() {
        let of = |freedoms: f64, energy: f64| RoughnessEvidence {
            freedoms: [freedoms; KINDS],
            energies: [energy; KINDS],
        };
        let both = of(10.0, 2.0).merge(&of(2.0, 4.0));
        assert_eq!(both.strengths(), [2.0; KINDS]);
        assert_eq!(RoughnessEvidence::default().strengths(), [0.0; KINDS]);
    }
}
