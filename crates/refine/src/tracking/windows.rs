//! Sliding windows: the last frames are solved together, so that tracking errors stay bounded.
//!
//! When a turn closes, frames may have drifted by many pixels, or hardly at all. The window is then
//! solved twice: from the finest level, which stays in the present minimum, and from the coarsest,
//! which reaches farther, but on a repetitive wall may converge to an alias. The solution with the
//! lower cost is kept.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::solver::argmin_glue::solve;
use crate::solver::stopping::Stopping;
use crate::thresholds::tracking::{LONG_WINDOW_FRAMES, WINDOW_HELD_DIVISOR};
use std::ops::Range;

/// Number of frames of a long window that are held.
const LONG_WINDOW_HELD: usize = LONG_WINDOW_FRAMES / WINDOW_HELD_DIVISOR;

/// Number of frames tracked between the solves of two long windows: as many as are held, so that
/// those held in one have been solved for in the window before.
pub const LONG_WINDOW_STRIDE: usize = LONG_WINDOW_HELD;

/// Solves the window that reaches from frame `first` to the last tracked one, the oldest third of
/// it held; `drifted`: the last frame may be many pixels off.
///
/// # Errors
/// [`ProblemError`].
pub fn solve_sliding_window(
    context: &EstimationContext,
    options: &RefineOptions,
    first: usize,
    drifted: bool,
    states: &mut FrameStates,
) -> Result<(), ProblemError> {
    let side = context.cameras.shorter_side();
    let (finest, coarsest) = (options.handover_level(side), options.coarsest_level(side));
    let frame_range = first..states.estimates.len();
    let held = if first == 0 {
        0
    } else {
        frame_range.len() / WINDOW_HELD_DIVISOR
    };
    let start = WindowState::of(states, &frame_range);
    let near_cost = solve_window(context, finest, frame_range.clone(), held, states)?;
    if !drifted {
        return Ok(());
    }
    let near = WindowState::of(states, &frame_range);
    start.restore(states, &frame_range);
    let mut far_cost = f64::INFINITY;
    for level in (finest..=coarsest).rev() {
        let context = context.at(states.kappa);
        far_cost = solve_window(&context, level, frame_range.clone(), held, states)?;
    }
    let far_is_better = far_cost < near_cost;
    if !far_is_better {
        near.restore(states, &frame_range);
    }
    Ok(())
}

/// Solves a long window that ends with the last tracked frame. Short windows leave a small bend,
/// which accumulates; several turns solved together straighten it.
///
/// # Errors
/// [`ProblemError`].
pub fn solve_long_window(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &mut FrameStates,
) -> Result<(), ProblemError> {
    let finest = options.handover_level(context.cameras.shorter_side());
    let end = states.estimates.len();
    let start = end.saturating_sub(LONG_WINDOW_FRAMES);
    let held = if start == 0 { 0 } else { LONG_WINDOW_HELD };
    let context = context.at(states.kappa);
    solve_window(&context, finest, start..end, held, states)?;
    Ok(())
}

/// The part of the frame states that the solve of a window changes.
struct WindowState {
    estimates: Vec<FrameEstimate>,
    kappa: Kappa,
}

impl WindowState {
    fn of(states: &FrameStates, frame_range: &Range<usize>) -> Self {
        Self {
            estimates: states.estimates[frame_range.clone()].to_vec(),
            kappa: states.kappa,
        }
    }

    fn restore(&self, states: &mut FrameStates, frame_range: &Range<usize>) {
        states.estimates[frame_range.clone()].copy_from_slice(&self.estimates);
        states.kappa = self.kappa;
    }
}

/// Solves the frames of a window together, the oldest `held` of them held; with the camera's
/// unknowns if these are to be estimated.
///
/// Returns the final cost per observation, grey levels²; infinity if no wall is seen twice.
fn solve_window(
    context: &EstimationContext,
    level: usize,
    frame_range: Range<usize>,
    held: usize,
    states: &mut FrameStates,
) -> Result<f64, ProblemError> {
    let active = frame_range.start + held..frame_range.end;
    let window = states.window_of(frame_range, active.clone());
    let problem =
        PhotometricProblem::new(context, Sampling::of(level), window)?.with_shared_parameters();
    if problem.tiles() == 0 {
        return Ok(f64::INFINITY);
    }
    let solution = solve(problem, Stopping::TRACKING)?;
    states.kappa = solution.unknowns.kappa;
    states.estimates[active].copy_from_slice(&solution.unknowns.frames);
    let record = solution.record;
    // Each problem estimates σ at its start; costs in units of it could not be compared.
    Ok(record.cost_end * record.sigma.powi(2) / record.observations as f64)
}
