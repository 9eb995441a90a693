//! Solves all frames from coarse to fine pyramid levels, each close enough for the next.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::solver::argmin_glue::solve;
use crate::solver::stopping::Stopping;
use std::ops::RangeInclusive;

/// Solves the poses and exposures of the inliers at the given pyramid levels, the highest first.
///
/// # Errors
/// [`ProblemError`].
pub fn solve_levels(
    context: &EstimationContext,
    options: &RefineOptions,
    levels: RangeInclusive<usize>,
    frames: &mut FrameStates,
) -> Result<(), ProblemError> {
    for level in levels.rev() {
        let problem = PhotometricProblem::new(context, Sampling::of(level), frames.window())?;
        let solution = solve(problem, Stopping::intermediate(options, level))?;
        frames.estimates = solution.unknowns.frames;
    }
    Ok(())
}
