//! Damped Gauss–Newton on the manifold of poses.
//!
//! This is the iteration itself, as plain code; [`crate::solver::argmin_glue`] hands it to
//! argmin's executor, which counts iterations and shows progress.

use crate::linear::factor_error::FactorError;
use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameEstimate, FrameStep, POSE};
use crate::parameters::unknowns::Unknowns;
use crate::problem::linearisation::Linearisation;
use crate::problem::patch_scores::PatchScores;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::solver::solve_record::{SolveRecord, StepRecord};
use crate::solver::stopping::{StopReason, Stopping};
use crate::thresholds::gauss_newton::{MAX_COST_RISE, MIN_SLOPE_REDUCTION};
use crate::thresholds::tracking::STEP_TOLERANCE_PX;
use serde::{Deserialize, Serialize};

/// Factor from one damping to the next.
///
/// Source: D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters",
/// Journal of the Society for Industrial and Applied Mathematics 11(2), 1963.
const DAMPING_FACTOR: f64 = 10.0;
/// First damping λ after a rejected step. A chain of N frames has modes down to `½ (π/N)²` of its
/// diagonal, 1e-4 for 220 frames: weaker dampings hardly shorten even these.
const MIN_DAMPING: f64 = 1e-4;
/// Dampings tried before a step is given up: none, and the powers of ten from [`MIN_DAMPING`] to
/// 100, where a step is a hundredth of that along the gradient.
const MAX_DAMPING_ITERATIONS: usize = 8;

/// Curvature along a step that lengthens the next one at the most: twofold.
const MIN_CURVATURE: f64 = 0.5;

/// The end of a solve.
pub struct Solution<'a> {
    /// The problem that was solved.
    pub problem: PhotometricProblem<'a>,
    /// The unknowns.
    pub unknowns: Unknowns,
    /// Cost and normal equations at the unknowns, or a step within the tolerance before.
    pub linearisation: Linearisation,
    /// The unknowns at which these are.
    pub linearised_at: Unknowns,
    /// Its course.
    pub record: SolveRecord,
}

impl Solution<'_> {
    /// Ties the first frame along the gauge of the given wall where measured points have left it
    /// free. Frames and points agree about it only as well as the initial poses and the shape tell;
    /// covariances are against the first frame.
    pub fn tie_gauge(&mut self) {
        let normal = &mut self.linearisation.normal;
        self.problem.tie_gauge(&self.linearised_at.frames, normal);
    }

    /// The scores of patches of the wall at the unknowns. The gradients of its blocks are taken
    /// from the linearisation.
    ///
    /// # Errors
    /// [`ProblemError::Frame`] if a frame has to be read again and cannot be.
    pub fn take_patch_scores(&mut self) -> Result<PatchScores, ProblemError> {
        let from_to = (&self.linearised_at, &self.unknowns);
        let gradients = self
            .problem
            .take_block_gradients(&mut self.linearisation, from_to)?;
        Ok(self.problem.patch_scores(&gradients))
    }

    /// Gives back the memory of the normal matrix, once the uncertainty is known.
    pub fn release_equations(&mut self) {
        self.linearisation.normal.blocks = Vec::new();
        self.linearisation.border = None;
    }

    /// Removes the shared parameters from the equations that are tested only.
    pub fn remove_tested(&mut self) {
        let at = &mut self.linearisation;
        if let Some(border) = &mut at.border {
            let tested = self.problem.tested().iter().enumerate();
            tested
                .filter(|(_, tested)| **tested)
                .for_each(|(k, _)| border.remove(k));
        }
    }
}

/// A solve between two steps; it can be resumed from there.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SolveState {
    /// The unknowns.
    pub unknowns: Unknowns,
    /// Steps taken or given up.
    pub iterations: u64,
    lambda: f64,
    length: f64,
    decrement: Option<f64>,
    cost_start: f64,
    steps: Vec<StepRecord>,
    /// The unknowns from whose equations those at `unknowns` were updated, and the n of the share,
    /// if they were.
    updated_from: Option<(Unknowns, usize)>,
}

/// Gauss–Newton with Levenberg–Marquardt damping `(H + λ diag H) δ = −g`.
///
/// λ starts at 0 and rises after a bad step, which is never taken. A step is good if it lowers the
/// robust cost on the same wall samples, or if, within a pixel, it removes at least half of the
/// slope along it ([`MIN_SLOPE_REDUCTION`]) and hardly raises the cost ([`MAX_COST_RISE`]).
///
/// The second rule is needed because the solve seeks a zero of the gradient, and the gradient is
/// not quite the derivative of the cost: it uses the slopes of the fused texture
/// ([`crate::tiles::tile`]) and is smooth, whereas the cost of sharp edges depends on where
/// samples fall between pixels. Along weak directions, in which all frames move together and hardly
/// against each other, that roughness exceeds the gain, and a solve that asked for a lower cost
/// would get stuck.
///
/// Frames that a step would make infeasible ([`PhotometricProblem::is_feasible`]) keep their
/// estimates. After a short step the equations are updated by a share of the tiles
/// ([`crate::problem::linearise_change`]), and computed from all of them where the step that
/// follows is not good. The last step, undamped and shorter than the tolerance, is not judged: cost
/// and equations are those before it.
///
/// Source: P. Wolfe, "Convergence conditions for ascent methods", SIAM Review 11(2), 1969 (the
/// slope along a step).
pub struct DampedGaussNewton {
    stopping: Stopping,
    lambda: f64,
    /// Length of the next undamped step, in Gauss–Newton steps.
    length: f64,
    /// Decrement `δᵀHδ` of the step before, if it was undamped and no frame was held.
    decrement: Option<f64>,
    /// Cost and equations at the present unknowns; None before the first linearisation.
    current: Option<Linearisation>,
    /// The unknowns at which `current` is.
    linearised_at: Unknowns,
    /// The unknowns from whose equations `current` was updated, and the n of the share, if it was.
    updated_from: Option<(Unknowns, usize)>,
    cost_start: Option<f64>,
    steps: Vec<StepRecord>,
    stop: Option<StopReason>,
}

impl DampedGaussNewton {
    /// Before the first step.
    pub fn new(stopping: Stopping) -> Self {
        Self {
            stopping,
            lambda: 0.0,
            length: 1.0,
            decrement: None,
            current: None,
            linearised_at: Unknowns::default(),
            updated_from: None,
            cost_start: None,
            steps: Vec::new(),
            stop: None,
        }
    }

    /// Before the first step, with the equations at the initial unknowns if they are known.
    pub fn starting(stopping: Stopping, at_start: Option<Linearisation>) -> Self {
        Self {
            current: at_start,
            ..Self::new(stopping)
        }
    }

    /// Between two steps, where an earlier solve of the same problem was.
    pub fn resume(stopping: Stopping, state: &SolveState) -> Self {
        Self {
            lambda: state.lambda,
            length: state.length,
            decrement: state.decrement,
            cost_start: Some(state.cost_start),
            steps: state.steps.clone(),
            updated_from: state.updated_from.clone(),
            ..Self::new(stopping)
        }
    }

    /// The state at `unknowns` after `iterations` iterations.
    pub fn state(&self, unknowns: &Unknowns, iterations: u64) -> SolveState {
        SolveState {
            unknowns: unknowns.clone(),
            iterations,
            lambda: self.lambda,
            length: self.length,
            decrement: self.decrement,
            cost_start: self.cost_start.unwrap_or_default(),
            steps: self.steps.clone(),
            updated_from: self.updated_from.clone(),
        }
    }

    /// The reason to stop, once there is one.
    pub fn stop(&self) -> Option<StopReason> {
        self.stop
    }

    /// One iteration: linearise, solve, accept. Returns the new unknowns and the cost there.
    ///
    /// # Errors
    /// [`ProblemError::Factor`] if the normal equations stay singular whatever the damping;
    /// [`ProblemError::Frame`] if a frame has to be read again and cannot be.
    pub fn iterate(
        &mut self,
        problem: &PhotometricProblem,
        unknowns: &Unknowns,
    ) -> Result<(Unknowns, f64), ProblemError> {
        let current = match self.current.take() {
            Some(current) => current,
            None => self.linearise(problem, unknowns)?,
        };
        self.cost_start.get_or_insert(current.cost);
        let (stepped, next) = self.step(problem, unknowns, current)?;
        // The last step is not judged.
        let linearised_at = if self.stop.is_some() {
            unknowns
        } else {
            &stepped
        };
        self.linearised_at.clone_from(linearised_at);
        let cost = next.cost;
        self.current = Some(next);
        Ok((stepped, cost))
    }

    /// The solution at `unknowns`, where the last iteration ended; None before the first.
    pub fn finish<'a>(
        self,
        problem: PhotometricProblem<'a>,
        unknowns: Unknowns,
    ) -> Option<Solution<'a>> {
        let linearisation = self.current?;
        let record = SolveRecord {
            iterations: self.steps.len() as u64,
            last_step_px: self.steps.last().map_or(0.0, |step| step.step_px),
            steps: self.steps,
            cost_start: self.cost_start.unwrap_or_default(),
            cost_end: linearisation.cost,
            observations: linearisation.frames.iter().map(|f| f.samples).sum(),
            sigma: problem.sigma(),
            stop: self.stop.unwrap_or(StopReason::MaxIterations),
        };
        Some(Solution {
            problem,
            unknowns,
            linearisation,
            linearised_at: self.linearised_at,
            record,
        })
    }

    /// The equations at `unknowns`, where an earlier solve was, updated if they were.
    fn linearise(
        &self,
        problem: &PhotometricProblem,
        unknowns: &Unknowns,
    ) -> Result<Linearisation, ProblemError> {
        match &self.updated_from {
            Some((from, stride)) => {
                let at = problem.linearise_at(from)?;
                problem.linearise_change(&at, (from, unknowns), *stride)
            }
            None => problem.linearise_at(unknowns),
        }
    }

    /// One accepted step from `unknowns`, where the problem is linearised as `current`; or the
    /// reason there is none.
    fn step(
        &mut self,
        problem: &PhotometricProblem,
        unknowns: &Unknowns,
        mut current: Linearisation,
    ) -> Result<(Unknowns, Linearisation), ProblemError> {
        let frames = &unknowns.frames;
        let mut undamped_failed = false;
        for _ in 0..MAX_DAMPING_ITERATIONS {
            let Some((mut step, mut shared)) = self.damped_step(problem, &current)? else {
                self.raise_damping();
                continue;
            };
            let length = if self.lambda == 0.0 { self.length } else { 1.0 };
            step.iter_mut().for_each(|step| *step *= length);
            shared *= length;
            let all_feasible = hold_infeasible_frames(problem, frames, &mut step);
            let moved = problem.wall_step_px(frames, &step, &shared);
            let step_px = moved.into_iter().fold(0.0, f64::max);
            let decrement = -current.slope(&step, &shared);
            let stop = self.reason_to_stop(step_px, decrement, FRAME_PARAMETERS * frames.len());
            if stop.is_some() && self.lambda > 0.0 {
                // It is the damping that makes the step short.
                if undamped_failed {
                    break;
                }
                self.lambda = 0.0;
                continue;
            }
            let candidate = problem.stepped(unknowns, &step, &shared);
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
            let is_updated = self.updated_from.is_some();
            let (share, next) =
                self.linearise_step(problem, &current, (unknowns, &candidate), step_px)?;
            let left = next.slope(&step, &shared);
            let settles = step_px < problem.pixel_px()
                && left.abs() < (1.0 - MIN_SLOPE_REDUCTION) * decrement
                && next.cost < (1.0 + MAX_COST_RISE) * current.cost;
            if next.cost < current.cost || settles {
                record.cost = Some(next.cost);
                // An undamped step is δ = −α H⁻¹ g, with its length α.
                let is_whole = self.lambda == 0.0 && all_feasible;
                let curvature = |before: f64, after: f64| (1.0 - after / before) / length;
                let of_poses = |at| pose_slope(&step[..frames.len()], at);
                record.curvature = is_whole.then(|| curvature(of_poses(&current), of_poses(&next)));
                self.decrement = is_whole.then_some(decrement);
                self.steps.push(record);
                self.length = if is_whole && step_px < STEP_TOLERANCE_PX {
                    next_length(curvature(-decrement, left))
                } else {
                    1.0
                };
                self.lower_damping();
                self.updated_from = share.map(|stride| (unknowns.clone(), stride));
                return Ok((candidate, next));
            }
            if is_updated {
                // Their errors, not the length of the step, may be what is bad.
                self.updated_from = None;
                current = problem.linearise_at(unknowns)?;
                continue;
            }
            undamped_failed |= self.lambda == 0.0;
            self.raise_damping();
        }
        self.stop = Some(StopReason::NoFurtherDescent);
        Ok((unknowns.clone(), current))
    }

    /// The equations after a step of `step_px`, with the n of the share by which the `current` ones
    /// were updated, if they were.
    fn linearise_step(
        &self,
        problem: &PhotometricProblem,
        current: &Linearisation,
        (unknowns, stepped): (&Unknowns, &Unknowns),
        step_px: f64,
    ) -> Result<(Option<usize>, Linearisation), ProblemError> {
        // Equations are updated once: errors would add up.
        let share = match self.updated_from {
            Some(_) => None,
            None => problem.change_share(current, step_px),
        };
        let next = match share {
            Some(stride) => problem.linearise_change(current, (unknowns, stepped), stride),
            None => problem.linearise_at(stepped),
        };
        Ok((share, next?))
    }

    /// The step `δ = −(H + λ diag H)⁻¹ g` of the slots and of the shared parameters; None if a
    /// stronger damping is needed.
    fn damped_step(
        &self,
        problem: &PhotometricProblem,
        current: &Linearisation,
    ) -> Result<Option<(Vec<FrameStep>, Kappa)>, ProblemError> {
        let normal = &current.normal;
        let factor = problem.symbolic().factorise(normal, self.lambda);
        let is_last_resort = self.lambda >= 1.0;
        let factor = match factor {
            Ok(factor) => factor,
            Err(source) if is_last_resort => return Err(problem.factor_error(source)),
            Err(_) => return Ok(None),
        };
        match current.step(&factor, self.lambda, problem.tested()) {
            None if is_last_resort => Err(problem.factor_error(FactorError::NotPositiveDefinite)),
            step => Ok(step),
        }
    }

    /// The reason for which a step that moves the wall by `step_px` and lowers the quadratic model
    /// by `½ decrement` is the last one, if it is: the step itself, or, at the end of a solve, what
    /// it leaves, is shorter than the tolerance. `unknowns` are those of the frames: the wall's
    /// shape has many more, most of which the prior determines.
    fn reason_to_stop(&self, step_px: f64, decrement: f64, unknowns: usize) -> Option<StopReason> {
        let left = match step_px < STEP_TOLERANCE_PX {
            true => share_left(self.decrement, decrement),
            false => 1.0,
        };
        if left * step_px < self.stopping.step_px {
            Some(StopReason::StepBelowTolerance)
        } else if left.powi(2) * decrement < self.stopping.step_sigma.powi(2) * unknowns as f64 {
            Some(StopReason::StepBelowUncertainty)
        } else {
            None
        }
    }

    fn raise_damping(&mut self) {
        self.lambda = (self.lambda * DAMPING_FACTOR).max(MIN_DAMPING);
    }

    fn lower_damping(&mut self) {
        self.lambda = if self.lambda > MIN_DAMPING {
            self.lambda / DAMPING_FACTOR
        } else {
            0.0
        };
    }
}

/// The length of the step after one along which the gradient has changed by `curvature` times what
/// the normal equations predict: the inverse, if it has changed by less. The steps at the end of a
/// solve all follow its weakest directions, so that curvatures hardly change from one to the next;
/// those of [`STEP_TOLERANCE_PX`] and more do not.
///
/// Source: J. Barzilai and J. M. Borwein, "Two-point step size gradient methods", IMA Journal of
/// Numerical Analysis 8(1), 1988.
fn next_length(curvature: f64) -> f64 {
    curvature.clamp(MIN_CURVATURE, 1.0).recip()
}

/// The share of an undamped step that is left after it, at the most 1: steps shrink by
/// `ρ = √(decrement/before)` from one to the next, so that those to come add up to `ρ/(1 − ρ)` of
/// it. `before`: the decrement of the step before, if that was undamped, too.
///
/// Source: J. Nocedal and S. J. Wright, "Numerical Optimization", 2006, chapter 10 (Gauss–Newton
/// converges linearly where residuals are left).
fn share_left(before: Option<f64>, decrement: f64) -> f64 {
    match before.map(|before| (decrement / before).sqrt()) {
        Some(ratio) if ratio < 1.0 => (ratio / (1.0 - ratio)).min(1.0),
        _ => 1.0,
    }
}

/// Sets the steps of frames to zero that would become infeasible: one frame that fits nowhere must
/// not hold back the others. Returns true if there are none.
fn hold_infeasible_frames(
    problem: &PhotometricProblem,
    estimates: &[FrameEstimate],
    step: &mut [FrameStep],
) -> bool {
    let mut all_feasible = true;
    for (estimate, step) in estimates.iter().zip(step) {
        if !problem.is_feasible(&estimate.retract(step)) {
            *step = FrameStep::zeros();
            all_feasible = false;
        }
    }
    all_feasible
}

/// The derivative of the cost along the poses of a step of the frames.
fn pose_slope(step: &[FrameStep], at: &Linearisation) -> f64 {
    let frames = step.iter().zip(&at.normal.gradient);
    let slopes = frames.map(|(step, gradient)| {
        let [step, gradient] = [step, gradient].map(|of| of.fixed_rows::<POSE>(0));
        step.dot(&gradient)
    });
    slopes.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps that shrink to a tenth leave a ninth; those that hardly shrink, or follow none, are
    /// taken to leave as much as they are.
    #[test]
    fn a_step_leaves_the_sum_of_those_to_come() {
        assert!((share_left(Some(100.0), 1.0) - 1.0 / 9.0).abs() < 1e-12);
        assert_eq!(share_left(Some(1.0), 0.8), 1.0);
        assert_eq!(share_left(None, 1.0), 1.0);
    }

    /// With half of the predicted curvature a step goes half of the way: the next one twice as far,
    /// and no farther. With more than that the step stays whole.
    #[test]
    fn steps_are_lengthened_by_missing_curvature_up_to_twofold() {
        assert_eq!([0.8, 0.5].map(next_length), [1.25, 2.0]);
        assert_eq!([1.0, 1.4, -0.3].map(next_length), [1.0, 1.0, 2.0]);
    }
}
