//! Stage: corrects the common shading until overlapping frames agree.

use crate::error::RefineError;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::tracking::shading_correction::correct_until_settled;

/// Runs the stage on the tracked frames, which it solves again in the corrected shading.
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
    correct_until_settled(&context, setup.options, &mut state.frames)?;
    session.record_time("shading");
    Ok(estimation)
}
