//! Damped Gauss–Newton on the manifold of poses, as a solver for argmin's executor.

use crate::progress::Progress;
use crate::refine::linear::sparse_cholesky::FactorError;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::parameters::calibration::Kappa;
use crate::refine::parameters::frame_estimate::{FrameEstimate, FrameStep, UNKNOWNS};
use crate::refine::problem::linearisation::Linearisation;
use crate::refine::problem::photometric_problem::Problem;
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{
    Error, Executor, IterState, KV, Problem as Counted, Solver, State, TerminationReason,
};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// When to stop.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Stopping {
    /// Steps at the most.
    pub max_iterations: u64,
    /// A step that moves no wall point by more than this ends the solve, pixels of full size.
    pub step_px: f64,
    /// A step shorter than this share of the estimate's own uncertainty ends the solve:
    /// `√(δᵀHδ / unknowns)`, with H the inverse covariance.
    pub step_sigma: f64,
}

/// Why a solve stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum StopReason {
    /// The last step moved the wall by less than the tolerance.
    StepBelowTolerance,
    /// The last step was a small share of the estimate's uncertainty.
    StepBelowUncertainty,
    /// No step, however damped, lowers the robust cost any more.
    NoFurtherDescent,
    /// The number of steps allowed was used up.
    MaxIterations,
}

/// One step of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StepRecord {
    /// Robust cost after it, on the same wall samples as at the start; None after a last step,
    /// which is not judged.
    pub cost: Option<f64>,
    /// Largest movement of the wall, pixels of full size.
    pub step_px: f64,
    /// λ with which it was taken; 0 is plain Gauss–Newton.
    pub damping: f64,
    /// How much the gradient changed along the step, over what the normal equations foretell:
    /// `δᵀ(g' − g)/δᵀHδ`, of the poses' part of the step δ. None where it was not looked at.
    pub curvature: Option<f64>,
}

/// The course of one solve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SolveRecord {
    /// Number of steps taken.
    pub iterations: u64,
    /// The steps.
    pub steps: Vec<StepRecord>,
    /// Robust cost at the start.
    pub cost_start: f64,
    /// Robust cost at the end, on the same wall samples, before the last step.
    pub cost_end: f64,
    /// Observations (wall sample × frame) compared.
    pub observations: usize,
    /// Largest movement of the wall in the last step, pixels of full size.
    pub last_step_px: f64,
    /// Noise of a pixel assumed, grey levels.
    pub sigma: f64,
    /// Why it stopped.
    pub stop: StopReason,
}

/// What the curvature is for Gaussian residuals and slopes without error: the mean of `ψ'` over
/// that of `ω` with [`crate::refine::tiles::residual_weighting::Loss`].
const USUAL_CURVATURE: f64 = 0.89;
/// The curvatures that are believed; others are those of a solve that was still far from its end.
const CURVATURES: RangeInclusive<f64> = 0.6..=1.2;

impl SolveRecord {
    /// How much the derivative of the gradient is of the normal matrix: the mean over all steps
    /// that tell, by the squares of their lengths ([`crate::refine::uncertainty::covariance`]).
    pub fn curvature(&self) -> f64 {
        let steps = self.steps.iter().filter_map(|step| {
            let curvature = step.curvature.filter(|of| CURVATURES.contains(of))?;
            Some((step.step_px.powi(2), curvature))
        });
        let (weights, sum) = steps.fold((0.0, 0.0), |(weights, sum), (weight, curvature)| {
            (weights + weight, sum + weight * curvature)
        });
        if weights > 0.0 {
            sum / weights
        } else {
            USUAL_CURVATURE
        }
    }
}

/// The derivative of the cost along the first `unknowns` of each frame's step: `δᵀ g`.
fn frames_slope(step: &[FrameStep], at: &Linearisation, unknowns: usize) -> f64 {
    let frames = step.iter().zip(&at.normal.gradient);
    let slopes =
        frames.map(|(step, gradient)| step.rows(0, unknowns).dot(&gradient.rows(0, unknowns)));
    slopes.sum()
}

/// The derivative of the cost along a whole step, that of the shared unknowns included.
fn slope(step: &[FrameStep], shared: &Kappa, at: &Linearisation) -> f64 {
    let border = at.border.as_ref();
    let of_shared = border.map_or(0.0, |border| shared.dot(&border.gradient));
    frames_slope(step, at, UNKNOWNS) + of_shared
}

/// Where a solve ended.
pub struct Solution<'a> {
    /// The problem that was solved.
    pub problem: Problem<'a>,
    /// Estimates of the active frames.
    pub estimates: Vec<FrameEstimate>,
    /// The shared unknowns.
    pub kappa: Kappa,
    /// Cost and normal equations there, or within the tolerance of there.
    pub linearisation: Linearisation,
    /// Its course.
    pub record: SolveRecord,
}

/// A solve between two steps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SolveState {
    unknowns: Unknowns,
    lambda: f64,
    cost_start: f64,
    steps: Vec<StepRecord>,
    /// Steps taken or given up.
    iterations: u64,
}

/// What is called between two steps.
pub type Between<'a> = dyn FnMut(SolveState) -> Result<(), ProblemError> + 'a;

/// What is estimated: the active frames and the shared unknowns.
type Unknowns = (Vec<FrameEstimate>, Kappa);

type Iterate = IterState<Unknowns, (), (), (), (), f64>;

/// Of the slope along a step, `δᵀ g`, this much must be gone after one that does not lower the
/// cost.
const LEAST_SLOPE_GONE: f64 = 0.5;
/// Share of the cost by which it may rise along a good step. On sharp bricks it rises and falls by
/// up to 0.9 % while the whole survey moves along its gauge, which changes nothing.
const ROUGHNESS: f64 = 0.01;
/// First damping tried after a rejected step, and the factor between tries.
const DAMPING: (f64, f64) = (1e-4, 10.0);
/// Tries before a step is given up.
const TRIES: usize = 8;

/// Gauss–Newton with Levenberg–Marquardt damping `(H + λ diag H) δ = −g`.
///
/// λ starts at 0 and rises when a step is none for the better; such a step is never taken. It is
/// for the better if it lowers the robust cost on the same wall samples; or, within a pixel, if it
/// leaves less than half of the slope along it ([`LEAST_SLOPE_GONE`]) and the cost as it was but
/// for its [`ROUGHNESS`]. What is sought is where the gradient is zero, and that is not quite the
/// derivative of the cost: it takes the slopes of the fused texture ([`crate::refine::tiles::tile`]), so it is
/// smooth, whereas the cost of sharp edges depends on where between pixels samples happen to fall.
/// Along weak directions, in which all frames move together by half a pixel and hardly against each
/// other, that outweighs what there is to gain, and a solve that asked for a lower cost would be
/// stuck.
///
/// Frames that a step would bring where they cannot be ([`Problem::admits`]) stay where they are.
/// Only the last step, undamped and shorter than the tolerance, is taken on trust: cost and
/// equations are those before it.
///
/// Source: P. Wolfe, "Convergence conditions for ascent methods", SIAM Review 11(2), 1969 (the
/// slope along a step).
struct DampedGaussNewton<'b> {
    stopping: Stopping,
    lambda: f64,
    current: Option<Linearisation>,
    /// None before the first linearisation.
    cost_start: Option<f64>,
    steps: Vec<StepRecord>,
    stop: Option<StopReason>,
    between: Option<&'b mut Between<'b>>,
}

impl DampedGaussNewton<'_> {
    /// Why a step that moves the wall by `step_px` and lowers the quadratic model by `½ decrement`
    /// is the last one, if it is.
    fn reason_to_stop(&self, step_px: f64, decrement: f64, unknowns: usize) -> Option<StopReason> {
        if step_px < self.stopping.step_px {
            Some(StopReason::StepBelowTolerance)
        } else if decrement < self.stopping.step_sigma.powi(2) * unknowns as f64 {
            Some(StopReason::StepBelowUncertainty)
        } else {
            None
        }
    }

    /// One accepted step, or the reason there is none.
    fn advance(
        &mut self,
        problem: &Problem,
        (estimates, kappa): &Unknowns,
        current: Linearisation,
    ) -> Result<(Unknowns, Linearisation), ProblemError> {
        let mut undamped_failed = false;
        for _ in 0..TRIES {
            let factor =
                problem
                    .symbolic()
                    .factorise(problem.pattern(), &current.normal, self.lambda);
            let factor = match factor {
                Ok(factor) => factor,
                Err(_) if self.lambda < 1.0 => {
                    self.raise_damping();
                    continue;
                }
                Err(source) => return Err(problem.factor_error(source)),
            };
            let gradient = &current.normal.gradient;
            let (mut step, shared) = match &current.border {
                None => (factor.step(gradient), Kappa::zeros()),
                Some(border) => match border.step(&factor, gradient, self.lambda) {
                    Some(step) => step,
                    None if self.lambda < 1.0 => {
                        self.raise_damping();
                        continue;
                    }
                    None => return Err(problem.factor_error(FactorError::NotPositiveDefinite)),
                },
            };
            // One frame that fits nowhere must not hold back the others.
            let mut whole = self.lambda == 0.0;
            for (estimate, step) in estimates.iter().zip(&mut step) {
                if !problem.admits(&estimate.retract(step)) {
                    *step = FrameStep::zeros();
                    whole = false;
                }
            }
            let moved = problem.wall_step_px(estimates, &step, &shared);
            let step_px = moved.into_iter().fold(0.0, f64::max);
            let decrement = -slope(&step, &shared, &current);
            let stop = self.reason_to_stop(step_px, decrement, UNKNOWNS * step.len());
            if stop.is_some() && self.lambda > 0.0 {
                // It is the damping that makes the step short.
                if undamped_failed {
                    break;
                }
                self.lambda = 0.0;
                continue;
            }
            let candidate: Vec<_> = estimates
                .iter()
                .zip(&step)
                .map(|(estimate, step)| estimate.retract(step))
                .collect();
            let candidate = (candidate, kappa + shared);
            let mut record = StepRecord {
                cost: None,
                step_px,
                damping: self.lambda,
                curvature: None,
            };
            if stop.is_some() {
                self.steps.push(record);
                self.stop = stop;
                return Ok((candidate, current));
            }
            let next = problem.linearise_at(&candidate.0, &candidate.1)?;
            let left = slope(&step, &shared, &next).abs();
            let settles = step_px < problem.pixel_px()
                && left < (1.0 - LEAST_SLOPE_GONE) * decrement
                && next.cost < (1.0 + ROUGHNESS) * current.cost;
            if next.cost < current.cost || settles {
                record.cost = Some(next.cost);
                // A whole undamped step is δ = −H⁻¹ g.
                let of_poses = |at| frames_slope(&step, at, 6);
                record.curvature = whole.then(|| 1.0 - of_poses(&next) / of_poses(&current));
                self.steps.push(record);
                self.lambda = if self.lambda > DAMPING.0 {
                    self.lambda / DAMPING.1
                } else {
                    0.0
                };
                return Ok((candidate, next));
            }
            undamped_failed |= self.lambda == 0.0;
            self.raise_damping();
        }
        self.stop = Some(StopReason::NoFurtherDescent);
        Ok(((estimates.clone(), *kappa), current))
    }

    fn raise_damping(&mut self) {
        self.lambda = (self.lambda * DAMPING.1).max(DAMPING.0);
    }
}

impl<'a> Solver<Problem<'a>, Iterate> for DampedGaussNewton<'_> {
    fn name(&self) -> &str {
        "damped Gauss–Newton"
    }

    fn next_iter(
        &mut self,
        problem: &mut Counted<Problem<'a>>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let unknowns = state.take_param().unwrap_or_default();
        let current = match self.current.take() {
            Some(current) => current,
            None => problem.problem("linearise", |p| {
                Ok(p.linearise_at(&unknowns.0, &unknowns.1)?)
            })?,
        };
        self.cost_start.get_or_insert(current.cost);
        let (unknowns, next) =
            problem.problem("step", |p| Ok(self.advance(p, &unknowns, current)?))?;
        state = state.param(unknowns).cost(next.cost);
        self.current = Some(next);
        if self.stop.is_some() {
            state = state.terminate_with(TerminationReason::SolverConverged);
        } else if state.get_iter() + 1 < state.get_max_iters()
            && let (Some(between), Some(unknowns)) = (&mut self.between, state.get_param())
        {
            between(SolveState {
                unknowns: unknowns.clone(),
                lambda: self.lambda,
                cost_start: self.cost_start.unwrap_or_default(),
                steps: self.steps.clone(),
                iterations: state.get_iter() + 1,
            })?;
        }
        Ok((state, None))
    }
}

/// Tells a [`Progress`] about every iteration.
struct Reporter {
    stage: String,
    progress: Arc<dyn Progress>,
}

impl Observe<Iterate> for Reporter {
    fn observe_iter(&mut self, state: &Iterate, _news: &KV) -> Result<(), Error> {
        self.progress.advance(1);
        self.progress.detail(&format!(
            "{}: step {}, cost {:.6e}",
            self.stage,
            state.get_iter() + 1,
            state.get_cost()
        ));
        Ok(())
    }
}

/// Solves `problem` from the estimates it was made with; `announce` names the stage to a progress
/// display.
///
/// # Errors
/// [`ProblemError::Factor`] if the normal equations stay singular whatever the damping.
pub fn solve<'a>(
    problem: Problem<'a>,
    stopping: Stopping,
    announce: Option<(&str, &Arc<dyn Progress>)>,
) -> Result<Solution<'a>, ProblemError> {
    go_on(problem, stopping, announce, None, None)
}

/// The same from where the solve of the same problem was, with a call between any two steps.
///
/// # Errors
/// As [`solve`], and those of `between`.
pub fn go_on<'a, 'b>(
    problem: Problem<'a>,
    stopping: Stopping,
    announce: Option<(&str, &Arc<dyn Progress>)>,
    begun: Option<SolveState>,
    between: Option<&'b mut Between<'b>>,
) -> Result<Solution<'a>, ProblemError> {
    let sigma = problem.sigma();
    let mut solver = DampedGaussNewton {
        stopping,
        lambda: 0.0,
        current: None,
        cost_start: None,
        steps: Vec::new(),
        stop: None,
        between,
    };
    let (mut start, mut done) = ((problem.start(), problem.kappa()), 0);
    if let Some(begun) = begun {
        (start, done) = (begun.unknowns, begun.iterations);
        (solver.lambda, solver.steps) = (begun.lambda, begun.steps);
        solver.cost_start = Some(begun.cost_start);
    }
    let mut executor = Executor::new(problem, solver).configure(|mut state| {
        state.iter = done;
        state.param(start).max_iters(stopping.max_iterations)
    });
    if let Some((_, progress)) = announce {
        progress.advance(done as usize);
    }
    if let Some((stage, progress)) = announce {
        executor = executor.add_observer(
            Reporter {
                stage: stage.to_owned(),
                progress: Arc::clone(progress),
            },
            ObserverMode::Always,
        );
    }
    let outcome = match executor.run() {
        Ok(outcome) => outcome,
        Err(error) => {
            return Err(error
                .downcast::<ProblemError>()
                .unwrap_or_else(|other| ProblemError::Solver(other.to_string())));
        }
    };
    let solver = outcome.solver;
    let (Some(problem), Some(linearisation), Some((estimates, kappa))) = (
        outcome.problem.get_problem(),
        solver.current,
        outcome.state.get_param().cloned(),
    ) else {
        return Err(ProblemError::Solver("no iterate was kept".to_owned()));
    };
    let record = SolveRecord {
        iterations: solver.steps.len() as u64,
        last_step_px: solver.steps.last().map_or(0.0, |step| step.step_px),
        steps: solver.steps,
        cost_start: solver.cost_start.unwrap_or_default(),
        cost_end: linearisation.cost,
        observations: linearisation.frames.iter().map(|f| f.samples).sum(),
        sigma,
        stop: solver.stop.unwrap_or(StopReason::MaxIterations),
    };
    Ok(Solution {
        problem,
        estimates,
        kappa,
        linearisation,
        record,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(steps: &[(f64, Option<f64>)]) -> SolveRecord {
        let steps = steps.iter().map(|(step_px, curvature)| StepRecord {
            cost: None,
            step_px: *step_px,
            damping: 0.0,
            curvature: *curvature,
        });
        SolveRecord {
            iterations: 0,
            steps: steps.collect(),
            cost_start: 0.0,
            cost_end: 0.0,
            observations: 0,
            last_step_px: 0.0,
            sigma: 1.0,
            stop: StopReason::StepBelowTolerance,
        }
    }

    #[test]
    fn long_steps_tell_the_curvature_and_strange_ones_do_not() {
        let told = record(&[(0.2, Some(0.9)), (0.1, Some(0.8)), (0.05, None)]);
        assert!((told.curvature() - (4.0 * 0.9 + 0.8) / 5.0).abs() < 1e-12);
        let strange = record(&[(3.0, Some(-0.4)), (1.0, Some(f64::NAN)), (0.1, None)]);
        assert_eq!(strange.curvature(), USUAL_CURVATURE);
    }

    /// Means over a Gaussian of unit variance.
    #[test]
    fn the_usual_curvature_is_that_of_gaussian_residuals() {
        use crate::refine::tiles::residual_weighting::Loss;
        let (mut weight, mut slope) = (0.0, 0.0);
        for k in -800..=800 {
            let e = 0.01 * f64::from(k);
            let density = (-0.5 * e * e).exp();
            let omega = |e: f64| f64::from(Loss::weight((e * e) as f32, 1.0));
            weight += density * omega(e);
            slope += density * ((e + 0.01) * omega(e + 0.01) - (e - 0.01) * omega(e - 0.01)) / 0.02;
        }
        assert!((slope / weight - USUAL_CURVATURE).abs() < 0.01);
    }
}
