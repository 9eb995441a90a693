//! Stage: rejects blurred frames, registers frames that tracking has rejected again, and solves.

use crate::error::RefineError;
use crate::solver::neighbourhood::Neighbourhood;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::thresholds::assessment::MAX_REGISTRATIONS;
use crate::tracking::track::register_rejected;
use crate::validation::blurred_frames::find_blurred_frames;
use crate::validation::sharpness::compare_sharpness;

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
    let (count, options) = (setup.count(), setup.options);
    let (coarsest, finest) = (setup.coarsest_level(), setup.handover_level());
    let frames = &mut state.frames;
    session.progress.start("sharpness", MAX_REGISTRATIONS);
    for iteration in 0..MAX_REGISTRATIONS {
        let ratios = compare_sharpness(&context, finest, frames)?;
        frames.reject(find_blurred_frames(&ratios, count));
        if iteration + 1 == MAX_REGISTRATIONS
            || !frames.has_majority()
            || register_rejected(&context, options, frames)? == 0
        {
            break;
        }
        Neighbourhood::of_all(frames).solve(&context, options, finest..=coarsest, frames)?;
        session.progress.advance(1);
    }
    session.progress.finish();
    session.record_time("sharpness");
    Ok(estimation)
}
