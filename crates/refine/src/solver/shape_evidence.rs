//! Strengths of the wall's shape, learned from the frames by evidence.
//!
//! At the end of a solve the cost is, nearly, a quadratic function of all unknowns x: the frames,
//! the shared parameters, and the coefficients c of the shape, which have the prior `N(0, σ_k²)`
//! with one strength for each scale k ([`crate::parameters::shape`]). With A the normal matrix for
//! the strengths σ and x̂ the minimiser of the cost E, the logarithm of the probability of the
//! pixels given the strengths is, but for a constant,
//!
//! `L(σ) = −E(x̂) − ½ log det A − Σ_k n_k log σ_k`,
//!
//! n_k the number of coefficients. It is largest where
//!
//! `σ_k² = |ĉ_k|²/γ_k`,  `γ_k = n_k − tr(A⁻¹)_kk/σ_k²`,
//!
//! γ_k being the number of coefficients that the pixels determine. Both count without mean, cos θ
//! and sin θ of the section ([`Functions::retain_deformation`]): as these are hardly seen, the
//! least error of the model moves them far, and they would raise the strength of the rest.
//! Iterating this goes there, with one factorisation a step and no pixel read. Traces come from
//! random signs z: the mean of `zᵀ A⁻¹ z`.
//!
//! A scale that does not raise L by more than chance does
//! ([`tunnelstitch_geometry::numerics::significance`]) is dropped, the least useful first: a wall
//! as planned ends without a shape, and its poses as if none had been looked for.
//!
//! The same L bounds what may hide below that: where coefficients of a dropped scale raise it by
//! `½ z²`, z the quantile of the false-alarm rate, they would have been seen
//! ([`crate::solver::evidence_fall`]); the strength at which it has fallen by ½, 1-σ, makes errors
//! ([`DroppedScale`], [`LearnedShape::unseen_errors`]).
//!
//! A solve that ends for want of descent, as where the wall is not smooth, leaves a gradient that
//! leads nowhere: then its end is taken for the minimum.
//!
//! Source: D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992 (the fixed
//! point); M. F. Hutchinson, "A stochastic estimator of the trace of the influence matrix",
//! Communications in Statistics 19(2), 1990.

use crate::linear::bordered_system::{SchurComplement, SharedBlock, SharedBorder};
use crate::linear::normal_equations::{NormalEquations, Pattern};
use crate::linear::sparse_cholesky::{Factor, SymbolicFactorisation};
use crate::parameters::calibration::{Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use crate::parameters::shape::{Scale, Shape, ShapeModel};
use crate::parameters::shape_functions::{Functions, ShapeStep};
use crate::parameters::unseen_errors::{EXPECTED_SQUARE, UNSEEN_DRAWS, UnseenError, UnseenErrors};
use crate::solver::evidence_fall::{EvidenceFall, seen_size};
use crate::solver::gauss_newton::Solution;
use nalgebra::SMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::Range;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::significance::normal_quantile;

/// Steps of the fixed point between two looks at which scales are of use.
const MAX_STEPS: usize = 8;
/// Change of the strengths' logarithms below which the fixed point is reached; the estimate hardly
/// depends on them.
const CONVERGED: f64 = 0.05;
/// Random sign vectors per scale. The relative error of γ is `√(2/(16 γ))` or less.
const PROBES: usize = 16;
/// Strength of a scale that is as good as dropped, over the given one.
const NEGLIGIBLE: f64 = 1e-4;
/// Largest factor of a strength in one step.
const MAX_STEP_FACTOR: f64 = 30.0;

/// A shape with learned strengths, and the minimum of the quadratic cost with these.
pub struct LearnedShape<'s> {
    equations: ShapeEquations<'s>,
    minimum: Minimum,
    sigmas_m: Vec<f64>,
    dropped: Vec<bool>,
}

/// A scale that is dropped, and how strong it may be all the same.
pub struct DroppedScale {
    /// Its index in the shape of the solve.
    index: usize,
    /// 1-σ of its strength, metres: where L has fallen by ½.
    typical_m: f64,
    /// The scale with the size of coefficients that would have been seen, but for the rate of false
    /// alarms.
    pub limit: Scale,
}

/// Learns the strengths of the shape at a solution; None if no shape was estimated, or if the
/// equations are singular. `most_m`: largest strength, metres; `alpha`: probability of finding a
/// shape where there is none.
pub fn learn_shape<'s>(
    solution: &'s Solution,
    most_m: f64,
    alpha: f64,
) -> Option<LearnedShape<'s>> {
    let problem = &solution.problem;
    let equations = ShapeEquations {
        pattern: problem.pattern(),
        symbolic: problem.symbolic(),
        normal: &solution.linearisation.normal,
        border: solution.linearisation.border.as_ref(),
        is_minimum: !solution.record.stop.is_converged(),
        shape: Shape {
            model: problem.shape()?.model.clone(),
            coefficients: solution.linearised_at.shape.clone(),
        },
        first_slot: solution.unknowns.frames.len(),
    };
    equations.learn(most_m, alpha)
}

/// The equations of all unknowns at a solution.
pub struct ShapeEquations<'s> {
    /// Pattern of the normal matrix.
    pub pattern: &'s Pattern,
    /// Its symbolic factorisation.
    pub symbolic: &'s SymbolicFactorisation,
    /// The normal equations, with the prior of the shape for the strengths of the solve.
    pub normal: &'s NormalEquations,
    /// Those of the shared parameters.
    pub border: Option<&'s SharedBorder>,
    /// True if the unknowns are taken for the minimum, whatever the gradient there.
    pub is_minimum: bool,
    /// The shape there, with the strengths of the solve.
    pub shape: Shape,
    /// Slot of its first block.
    pub first_slot: usize,
}

/// The minimum of the quadratic cost for some strengths. The factor of the normal matrix is not
/// kept: it takes most of the memory.
struct Minimum {
    /// Elimination of the slots from the border, if there is one.
    schur: Option<SchurComplement>,
    /// Step of all slots to it.
    step: Vec<FrameStep>,
    /// Step of the shared parameters.
    shared: Kappa,
    /// L, but for a constant.
    log_evidence: f64,
}

impl Minimum {
    /// Step of slots and shared parameters that a gradient of the slots makes, with the shared
    /// parameters `held` known; `factor`: of the normal matrix for the strengths.
    fn response(
        &self,
        factor: &Factor,
        gradient: &[FrameStep],
        held: &[bool; SHARED_PARAMETERS],
    ) -> Option<(Vec<FrameStep>, Kappa)> {
        match &self.schur {
            Some(schur) => {
                let step = schur.step(factor, gradient, &Kappa::zeros())?;
                schur.step_holding(step, &held.map(|held| held.then_some(0.0)))
            }
            None => Some((factor.step(gradient), Kappa::zeros())),
        }
    }
}

impl<'s> ShapeEquations<'s> {
    /// Strengths of the scales, metres.
    fn sigmas_m(&self) -> Vec<f64> {
        let scales = self.shape.model.scales.iter();
        scales.map(|scale| scale.sigma_m).collect()
    }

    /// Slots of each scale.
    fn slots(&self) -> impl Iterator<Item = Range<usize>> {
        let ranges = self.shape.model.ranges().into_iter();
        ranges.map(|range| range.start + self.first_slot..range.end + self.first_slot)
    }

    /// Learns the strengths, and drops scales of no use ([`learn_shape`]); None if the equations
    /// are singular.
    pub fn learn(self, most_m: f64, alpha: f64) -> Option<LearnedShape<'s>> {
        let count = self.shape.model.scales.len();
        let mut sigmas_m = self.sigmas_m();
        let mut dropped = vec![false; count];
        let threshold = 0.5 * normal_quantile(alpha, count).powi(2);
        loop {
            let minimum = self.fixed_point(&mut sigmas_m, most_m, &dropped)?;
            // The weakest ones gain nothing.
            for (k, dropped) in dropped.iter_mut().enumerate() {
                *dropped |= sigmas_m[k] <= self.weakest_m(k);
            }
            let gain = |k: usize| {
                let mut without = sigmas_m.clone();
                without[k] = self.weakest_m(k);
                let without = self.minimum(&without)?.log_evidence;
                Some((k, minimum.log_evidence - without))
            };
            let left: Vec<usize> = (0..count).filter(|k| !dropped[*k]).collect();
            let gains = left.par_map(|k| gain(*k)).into_iter();
            let gains: Vec<(usize, f64)> = gains.collect::<Option<_>>()?;
            let worst = gains.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
            match worst.filter(|(_, gain)| *gain < threshold) {
                Some((k, _)) => {
                    dropped[k] = true;
                    sigmas_m[k] = self.weakest_m(k);
                }
                None => {
                    return Some(LearnedShape {
                        equations: self,
                        minimum,
                        sigmas_m,
                        dropped,
                    });
                }
            }
        }
    }

    /// The strength of scale `k` when it is as good as dropped, metres. Weaker ones are lost in
    /// rounding.
    fn weakest_m(&self, k: usize) -> f64 {
        NEGLIGIBLE * self.shape.model.scales[k].sigma_m
    }

    /// The factor of the normal matrix for the strengths `sigmas_m`; None if it is singular.
    fn factor(&self, sigmas_m: &[f64]) -> Option<Factor<'s>> {
        let mut changes = vec![0.0; self.pattern.columns()];
        let scales = self.shape.model.scales.iter().zip(sigmas_m);
        for ((scale, sigma_m), slots) in scales.zip(self.slots()) {
            changes[slots].fill(sigma_m.powi(-2) - scale.sigma_m.powi(-2));
        }
        let diagonal = |slot: usize, own: f64| own + changes[slot];
        let factor = (self.symbolic).factorise_with(self.normal, diagonal);
        factor.ok()
    }

    /// The minimum for the strengths `sigmas_m`; None if the equations are singular.
    fn minimum(&self, sigmas_m: &[f64]) -> Option<Minimum> {
        self.minimum_by(&self.factor(sigmas_m)?, sigmas_m)
    }

    /// The minimum for the strengths `sigmas_m` by the factor for these.
    fn minimum_by(&self, factor: &Factor, sigmas_m: &[f64]) -> Option<Minimum> {
        let mut gradient = self.normal.gradient.clone();
        let mut shared_gradient = self.border.map_or(Kappa::zeros(), |border| border.gradient);
        if self.is_minimum {
            gradient.fill(FrameStep::zeros());
            shared_gradient.fill(0.0);
        }
        let (mut prior_cost, mut log_volume) = (0.0, 0.0);
        let scales = self.shape.model.scales.iter().zip(sigmas_m);
        for ((scale, sigma_m), slots) in scales.zip(self.slots()) {
            let information = sigma_m.powi(-2);
            let change = information - scale.sigma_m.powi(-2);
            log_volume += (slots.len() * FRAME_PARAMETERS) as f64 * sigma_m.ln();
            for slot in slots {
                let coefficients = &self.shape.coefficients[slot - self.first_slot];
                gradient[slot] += coefficients * change;
                prior_cost += 0.5 * information * coefficients.norm_squared();
            }
        }
        let eliminated = self.border.map(|border| border.eliminate(factor, 0.0));
        let mut log_determinant = factor.log_determinant();
        let (step, shared) = match &eliminated {
            Some(schur) => schur.step(factor, &gradient, &shared_gradient)?,
            None => (factor.step(&gradient), Kappa::zeros()),
        };
        let slopes = step.iter().zip(&gradient);
        let mut slope: f64 = slopes.map(|(step, gradient)| step.dot(gradient)).sum();
        if let Some(schur) = &eliminated {
            slope += shared.dot(&shared_gradient);
            let l = schur.schur.cholesky()?.l();
            log_determinant += 2.0 * l.diagonal().iter().map(|d| d.ln()).sum::<f64>();
        }
        Some(Minimum {
            schur: eliminated,
            step,
            shared,
            log_evidence: -(prior_cost + 0.5 * slope) - 0.5 * log_determinant - log_volume,
        })
    }

    /// Goes to the strengths of the largest evidence up to `most_m`, but for those of `dropped`
    /// scales, and returns the minimum there.
    fn fixed_point(&self, sigmas_m: &mut [f64], most_m: f64, dropped: &[bool]) -> Option<Minimum> {
        for _ in 0..MAX_STEPS {
            let factor = self.factor(sigmas_m)?;
            let minimum = self.minimum_by(&factor, sigmas_m)?;
            let mut largest_change = 0.0f64;
            for (k, slots) in self.slots().enumerate() {
                if dropped[k] {
                    continue;
                }
                let functions = &self.shape.model.scales[k].functions;
                let n = functions.deformations() as f64;
                let trace = self.trace((&factor, &minimum), &slots, functions)?;
                let determined = n - trace / sigmas_m[k].powi(2);
                let coefficient = |slot: usize| {
                    let before = &self.shape.coefficients[slot - self.first_slot];
                    before + minimum.step[slot]
                };
                let mut coefficients: Vec<ShapeStep> = slots.map(coefficient).collect();
                functions.retain_deformation(&mut coefficients);
                let square: f64 = coefficients.iter().map(|c| c.norm_squared()).sum();
                let learned = (square / determined.max(f64::MIN_POSITIVE)).sqrt();
                let factor = (learned.min(most_m) / sigmas_m[k])
                    .clamp(1.0 / MAX_STEP_FACTOR, MAX_STEP_FACTOR);
                let next_m = (factor * sigmas_m[k]).max(self.weakest_m(k));
                largest_change = largest_change.max((next_m / sigmas_m[k]).ln().abs());
                sigmas_m[k] = next_m;
            }
            if largest_change < CONVERGED {
                break;
            }
        }
        self.minimum(sigmas_m)
    }

    /// `tr(P A⁻¹ P)` over some slots, P the projection [`Functions::retain_deformation`].
    fn trace(
        &self,
        (factor, minimum): (&Factor, &Minimum),
        slots: &Range<usize>,
        functions: &Functions,
    ) -> Option<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(slots.start as u64);
        let mut z = vec![SMatrix::<f64, FRAME_PARAMETERS, PROBES>::zeros(); self.pattern.columns()];
        for block in &mut z[slots.clone()] {
            *block = SMatrix::from_fn(|_, _| if rng.random() { 1.0 } else { -1.0 });
        }
        functions.retain_deformation(&mut z[slots.clone()]);
        let solved = factor.solve(&z);
        let products = z.iter().zip(&solved);
        let mut trace: f64 = products.map(|(z, s)| z.component_mul(s).sum()).sum();
        if let Some(SchurComplement { w, schur }) = &minimum.schur {
            let mut reduced = SMatrix::<f64, SHARED_PARAMETERS, PROBES>::zeros();
            for slot in slots.clone() {
                reduced += w[slot].transpose() * z[slot];
            }
            let solved = schur.cholesky()?.solve(&reduced);
            trace += reduced.component_mul(&solved).sum();
        }
        Some(trace / PROBES as f64)
    }
}

impl LearnedShape<'_> {
    /// Step of the shared parameters to the minimum, and their information; None if they were not
    /// estimated.
    pub fn shared(&self) -> Option<(Kappa, SharedBlock)> {
        let schur = self.minimum.schur.as_ref()?;
        Some((self.minimum.shared, schur.schur))
    }

    /// Step of all slots and of the shared parameters to the minimum where the latter make the
    /// step `held` ([`SchurComplement::step_holding`]).
    pub fn step_holding(
        &self,
        held: &[Option<f64>; SHARED_PARAMETERS],
    ) -> Option<(Vec<FrameStep>, Kappa)> {
        let step = (self.minimum.step.clone(), self.minimum.shared);
        match &self.minimum.schur {
            Some(schur) => schur.step_holding(step, held),
            None => Some(step),
        }
    }

    /// The dropped scales, with the strengths up to `most_m` metres that they may have, `alpha`
    /// being the rate of false alarms; without those for which the equations are singular.
    pub fn dropped_scales(&self, most_m: f64, alpha: f64) -> Vec<DroppedScale> {
        let scales = &self.equations.shape.model.scales;
        let dropped: Vec<usize> = (0..scales.len()).filter(|k| self.dropped[*k]).collect();
        let fall = |z: f64| 0.5 * z * z;
        let found = dropped.par_map(|k| {
            let of_strength = |sigma_m: f64| {
                let mut sigmas_m = self.sigmas_m.clone();
                sigmas_m[*k] = sigma_m;
                let log_evidence = self.equations.minimum(&sigmas_m)?.log_evidence;
                Some(self.minimum.log_evidence - log_evidence)
            };
            let least_m = NEGLIGIBLE * scales[*k].sigma_m;
            let seen = fall(normal_quantile(alpha, 1));
            let size = seen_size(scales[*k].functions.deformations() as f64, seen);
            let mut falls = EvidenceFall::default();
            let mut strength_m =
                |fall: f64, most_m: f64| falls.strength_m(fall, [least_m, most_m], of_strength);
            Some(DroppedScale {
                index: *k,
                typical_m: strength_m(fall(1.0), most_m)?,
                limit: Scale {
                    sigma_m: size * strength_m(seen, most_m / size)?,
                    ..scales[*k]
                },
            })
        });
        found.into_iter().flatten().collect()
    }

    /// Draws the errors that these dropped scales make
    /// ([module documentation](crate::parameters::unseen_errors)), with the shared parameters
    /// `held` known; none if the equations are singular. `seed`: another one for every solve.
    pub fn unseen_errors(
        &self,
        dropped: &[DroppedScale],
        held: &[bool; SHARED_PARAMETERS],
        seed: u64,
    ) -> UnseenErrors {
        let equations = &self.equations;
        if dropped.is_empty() {
            return UnseenErrors::default();
        }
        let Some(factor) = equations.factor(&self.sigmas_m) else {
            return UnseenErrors::default();
        };
        let slots: Vec<Range<usize>> = equations.slots().collect();
        let draws = (0..UNSEEN_DRAWS).par_map(|draw| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(draw as u64);
            let mut gradient = vec![FrameStep::zeros(); equations.pattern.columns()];
            for scale in dropped {
                let information = self.sigmas_m[scale.index].powi(-2);
                let amplitude = EXPECTED_SQUARE.sqrt() * scale.typical_m * information;
                for slot in slots[scale.index].clone() {
                    gradient[slot] = FrameStep::from_fn(|_, _| StandardNormal.sample(&mut rng));
                    gradient[slot] *= amplitude;
                }
            }
            let (step, shared) = self.minimum.response(&factor, &gradient, held)?;
            let (frames, shape) = step.split_at(equations.first_slot);
            Some(UnseenError {
                frames: frames.to_vec(),
                shared,
                displacement: equations.shape.model.field_of(shape.to_vec())?,
            })
        });
        UnseenErrors {
            draws: draws.into_iter().collect::<Option<_>>().unwrap_or_default(),
        }
    }

    /// Step of all slots to the minimum.
    pub fn step(&self) -> &[FrameStep] {
        &self.minimum.step
    }

    /// Number of coefficients that the data determine, without mean, cos θ and sin θ of sections.
    pub fn determined(&self) -> Option<f64> {
        let equations = &self.equations;
        let factor = equations.factor(&self.sigmas_m)?;
        let mut determined = 0.0;
        for (k, slots) in equations.slots().enumerate() {
            if !self.dropped[k] {
                let functions = &equations.shape.model.scales[k].functions;
                let trace = equations.trace((&factor, &self.minimum), &slots, functions)?;
                determined += functions.deformations() as f64 - trace / self.sigmas_m[k].powi(2);
            }
        }
        Some(determined)
    }

    /// The shape after a step of all slots, without the dropped scales.
    pub fn shape_after(&self, step: &[FrameStep]) -> Shape {
        let before = &self.equations.shape;
        let moved = before.stepped(&step[self.equations.first_slot..]);
        let mut model: ShapeModel = before.model.clone();
        let mut coefficients = Vec::new();
        for (k, range) in before.model.ranges().into_iter().enumerate() {
            model.scales[k].sigma_m = self.sigmas_m[k];
            if !self.dropped[k] {
                coefficients.extend_from_slice(&moved[range]);
            }
        }
        let mut kept = self.dropped.iter().map(|dropped| !dropped);
        model.scales.retain(|_| kept.next().unwrap_or_default());
        Shape {
            model,
            coefficients,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::normal_equations::Block;
    use tunnelstitch_geometry::surface::WallPoint;

    /// Every coefficient is observed with an error of 1 mm; those of one lattice are 5 mm, all
    /// others 0. Strengths begin at 10 mm.
    #[test]
    fn strengths_are_those_of_the_wall_and_useless_scales_are_dropped() {
        let model = ShapeModel::new(18.0, WallPoint::default(), [0.0, 9.0], 16, 0.01);
        let blocks = model.blocks();
        let ranges = model.ranges();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal_number = || -> f64 { StandardNormal.sample(&mut rng) };
        let pattern = Pattern::new(1 + blocks, []);
        let mut normal = NormalEquations::zeros(&pattern);
        normal.add_block(&pattern, 0, 0, &Block::identity());
        let mut truth = vec![ShapeStep::zeros(); blocks];
        for block in &mut truth[ranges[3].clone()] {
            *block = ShapeStep::from_fn(|_, _| 0.005 * normal_number());
        }
        let mut of_functions = vec![ShapeStep::repeat(1.0); blocks];
        for (scale, range) in model.scales.iter().zip(&ranges) {
            if let Functions::Harmonics { .. } = scale.functions {
                let of_scale = &mut of_functions[range.clone()];
                scale.functions.retain_deformation(of_scale);
            }
        }
        for (k, (c, of_functions)) in truth.iter().zip(&of_functions).enumerate() {
            let observed = c + ShapeStep::from_fn(|_, _| 0.001 * normal_number());
            let pixels = of_functions * 1e6;
            let information = Block::identity() * 1e4 + Block::from_diagonal(&pixels);
            normal.add_block(&pattern, 1 + k, 1 + k, &information);
            normal.gradient[1 + k] = -observed.component_mul(&pixels);
        }
        let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
        let equations = ShapeEquations {
            pattern: &pattern,
            symbolic: &symbolic,
            normal: &normal,
            border: None,
            is_minimum: false,
            shape: Shape::nominal(model),
            first_slot: 1,
        };
        let learned = equations.learn(0.03, 1e-3).unwrap();
        // Each of n coefficients is known to 1 mm, so L falls by about n σ⁴/4 mm⁴.
        let dropped = learned.dropped_scales(0.03, 1e-3);
        assert!(!dropped.is_empty());
        for DroppedScale { limit, .. } in &dropped {
            let n = limit.functions.deformations() as f64;
            let expected_m = 1e-3 * (4.0 * 4.77 / n).powf(0.25);
            assert!(
                (0.5..2.5).contains(&(limit.sigma_m / expected_m)),
                "{limit:?}"
            );
        }
        // What no pixel ties to the frame displaces the wall alone, by as much as L admits.
        let unseen = learned.unseen_errors(&dropped, &[false; SHARED_PARAMETERS], 1);
        let variance = |scale: &DroppedScale| {
            let rms = scale.limit.functions.rms();
            (rms * scale.typical_m).powi(2)
        };
        let expected = EXPECTED_SQUARE * dropped.iter().map(variance).sum::<f64>();
        let at = |k: usize| WallPoint {
            s_m: (k as f64 * 7.3) % 18.0,
            h_m: 1.0 + (k as f64 * 3.1) % 7.0,
        };
        let square = |error: &UnseenError| {
            assert_eq!(error.frames, [FrameStep::zeros()]);
            let squares = (0..100).map(|k| error.displacement.at(at(k)).delta_m.powi(2));
            squares.sum::<f64>() / 100.0
        };
        let share = unseen.mean(square) / expected;
        assert!((0.6..1.5).contains(&share), "{share}");
        let learned = learned.shape_after(learned.step());
        let scales = &learned.model.scales;
        assert_eq!(scales.len(), 1, "{scales:?}");
        assert!((scales[0].sigma_m / 0.005 - 1.0).abs() < 0.15, "{scales:?}");
        let errors = learned.coefficients.iter().zip(&truth[ranges[3].clone()]);
        let square: f64 = errors.map(|(c, truth)| (c - truth).norm_squared()).sum();
        let rms_m = (square / (8 * ranges[3].len()) as f64).sqrt();
        assert!((0.8e-3..1.1e-3).contains(&rms_m), "{rms_m}");
    }
}
