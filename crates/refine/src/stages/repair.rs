//! Stage: repairs the trajectory where frames do not support each other.

use crate::error::RefineError;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::validation::repair;

/// Runs the stage on frames that have been solved at full size; without such a solve it does
/// nothing.
///
/// # Errors
/// A frame that cannot be read, equations without a solution.
pub fn run<'a>(
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let state = &mut estimation.state;
    if state.levels.is_empty() {
        return Ok(estimation);
    }
    let context = setup.context(state);
    state.aliases = repair::repair(
        &context,
        setup.options,
        &mut state.frames,
        state.solved.clone(),
        session.progress.as_ref(),
    )?;
    session.record_time("repair");
    Ok(estimation)
}
