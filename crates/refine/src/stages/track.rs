//! Stage: registers one frame after another, alternating with shading and camera while these are
//! only roughly known.

use crate::error::RefineError;
use crate::model::context::EstimationContext;
use crate::solver::stopping::Stopping;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::{Estimation, PipelineState};
use crate::tracking::alternating_calibration::AlternatingCalibration;
use crate::tracking::focal_search::search_focal_length;

/// Runs the stage; a snapshot may be kept after every frame.
///
/// # Errors
/// A frame that cannot be read, an initial pose outside the tunnel, equations without a solution.
pub fn run<'a>(
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let state = &mut estimation.state;
    let initial = setup.initial_context(state.noise);
    let context = EstimationContext {
        prior: &setup.tracking_prior,
        ..initial.clone()
    };
    let progress = session.progress.clone();
    let tracking = match state.tracking.take() {
        Some(tracking) => tracking,
        None => {
            let rejections = state.frames.rejections.clone();
            let (options, progress) = (setup.options, progress.as_ref());
            let kappa = search_focal_length(&context, options, &rejections, progress)?;
            AlternatingCalibration::new(rejections, kappa)
        }
    };
    let stopping = Stopping::intermediate(setup.options, setup.handover_level());
    let keep = |tracking: &AlternatingCalibration| {
        session.keep_if_due(setup, || PipelineState {
            tracking: Some(tracking.clone()),
            ..state.clone()
        })
    };
    match tracking.run(&context, setup.options, stopping, progress.as_ref(), keep)? {
        Some(frames) => {
            state.kappa = initial.at(frames.kappa).kappa;
            state.frames = frames;
        }
        None => state.has_common_light = false,
    }
    session.record_time("track");
    Ok(estimation)
}
