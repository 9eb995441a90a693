//! Stage: rejects frames that show nothing, and finds a first model of the light and the sensor's
//! noise.

use crate::error::RefineError;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::tracking::first_light::first_light;
use crate::tracking::light_model::take_over;
use crate::tracking::prescreening;
use tunnelstitch_core::frames::Light;

/// Runs the stage on every frame at the coarsest pyramid level.
///
/// # Errors
/// A frame that cannot be read.
pub fn run<'a>(
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let context = setup.initial_context(estimation.state.noise);
    let coarsest = setup.coarsest_level();
    let prescreened = prescreening::prescreen(&context, coarsest, session.progress.as_ref())?;
    if let (Light::Even, Some(mean)) = (setup.frames.light(), &prescreened.mean)
        && let Some(light) = first_light(&context, mean, coarsest, setup.options.false_alarm_rate)
    {
        take_over(light, &context, &[]);
    }
    estimation.state.noise = prescreened.noise;
    estimation.state.frames.rejections = prescreened.rejections;
    session.record_time("decode");
    Ok(estimation)
}
