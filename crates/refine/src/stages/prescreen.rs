//! Stage: rejects frames that show nothing, estimates the common shading and the sensor's noise.

use crate::error::RefineError;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::tracking::prescreening;
use std::sync::Arc;
use tunnelstitch_core::frames::{CameraLight, Light};

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
    if let (Light::Even, Some(shading)) = (setup.frames.light(), prescreened.shading) {
        setup
            .frames
            .set_light(Light::Shaded(Arc::new(CameraLight::common(shading))));
    }
    estimation.state.noise = prescreened.noise;
    estimation.state.frames.rejections = prescreened.rejections;
    session.record_time("decode");
    Ok(estimation)
}
