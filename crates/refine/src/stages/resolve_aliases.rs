//! Stage: moves frames to where the prior has them if they fit there as well, and rejects those
//! with an alias that the prior does not exclude: the last solve must not rest on them.

use crate::error::RefineError;
use crate::model::rejection::RejectionReason;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::tracking::pose_separation::separation_m;
use crate::validation::aliasing::resolve_all_aliases;

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
    let aliases = resolve_all_aliases(&context, setup.options, &mut state.frames)?;
    for (frame, motion) in aliases {
        let pose = &state.frames.estimates[frame].pose;
        let other = motion.apply(pose);
        let separation_m = separation_m(
            context.surface.as_ref(),
            context.cameras.of(frame),
            pose,
            &other,
        );
        let ambiguous = RejectionReason::Ambiguous {
            other,
            separation_m,
        };
        state.frames.rejections[frame].get_or_insert(ambiguous);
    }
    session.record_time("aliases");
    Ok(estimation)
}
