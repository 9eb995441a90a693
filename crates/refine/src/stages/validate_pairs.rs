//! Stage: compares all frames pair by pair, rejects those that contradict the others or are
//! blurred, registers rejected ones again, and solves.

use crate::comparison::blurred_frames::find_blurred_frames;
use crate::comparison::inconsistent_frames::FrameComparison;
use crate::error::RefineError;
use crate::solver::solve_levels::solve_levels;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::thresholds::assessment::MAX_PAIR_ITERATIONS;
use crate::tracking::track::register_rejected;

/// Runs the stage at the finest level of tracking.
///
/// # Errors
/// A frame that cannot be read, equations without a solution.
pub fn run<'a>(
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let state = &mut estimation.state;
    let context = setup.context(state);
    let options = setup.options;
    let (coarsest, finest) = (setup.coarsest_level(), setup.handover_level());
    let frames = &mut state.frames;
    session.progress.start("check", MAX_PAIR_ITERATIONS);
    for iteration in 0..MAX_PAIR_ITERATIONS {
        let comparison = FrameComparison::of(&context, finest, frames)?;
        frames.reject(comparison.contradictions());
        frames.reject(find_blurred_frames(&comparison.pairs, comparison.frames));
        if iteration + 1 == MAX_PAIR_ITERATIONS
            || !frames.outnumber_misplaced()
            || register_rejected(&context, options, frames)? == 0
        {
            break;
        }
        solve_levels(&context, options, finest..=coarsest, frames)?;
        session.progress.advance(1);
    }
    session.progress.finish();
    session.record_time("check");
    Ok(estimation)
}
