//! The pipeline: the stages of a refinement, one after another.

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::parameters::calibration::Kappa;
use crate::parameters::unseen_errors::UnseenErrors;
use crate::refined::Refined;
use crate::stages::assess::without_solution;
use crate::stages::plan::plan_stages;
use crate::stages::run::run_stage;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::{Estimation, PipelineState};
use std::sync::Arc;
use tunnelstitch_core::persist::checkpoint::Checkpoint;
use tunnelstitch_core::progress::Progress;

/// Refines the poses of frames: a [`RefineInput`], or a
/// [`Survey`](tunnelstitch_core::survey::Survey) that converts into one.
///
/// Equal input gives equal bytes, whatever the number of threads.
///
/// # Errors
/// [`RefineError`].
pub fn refine<'a>(
    input: impl Into<RefineInput<'a>>,
    options: &RefineOptions,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    refine_with_checkpoint(input, options, None, progress)
}

/// Refines the poses of frames, with snapshots kept in a checkpoint; resumes from the snapshot that
/// is in it.
///
/// The result has the same bytes however often the run was interrupted, but for the times that
/// stages took.
///
/// # Errors
/// [`RefineError`].
pub fn refine_with_checkpoint<'a>(
    input: impl Into<RefineInput<'a>>,
    options: &RefineOptions,
    checkpoint: Option<&mut Checkpoint>,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    let setup = Setup::new(input.into(), options)?;
    let mut session = Session::new(checkpoint, progress);
    let state = session.restore(&setup)?;
    let mut estimation = Estimation {
        state: state.unwrap_or_else(|| begin(&setup)),
        solution: None,
        refined: None,
    };
    while let Some(stage) = estimation.state.stages.front().copied() {
        // The solution that the assessment uses is no part of a snapshot.
        if estimation.solution.is_none() {
            session.keep_if_due(&setup, || estimation.state.clone())?;
        }
        estimation = match run_stage(stage, &setup, estimation, &mut session) {
            Ok(estimation) => estimation,
            // Poses that nothing determines are those given.
            Err(RefineError::Problem(ProblemError::Factor { .. })) => {
                return Ok(without_solution(&setup, &mut session));
            }
            Err(error) => return Err(error),
        };
        estimation.state.stages.pop_front();
    }
    estimation.refined.ok_or(RefineError::NoOverlap)
}

/// The state before the first stage.
fn begin(setup: &Setup) -> PipelineState {
    let frames = FrameStates {
        estimates: Vec::new(),
        rejections: vec![None; setup.count()],
        kappa: Kappa::zeros(),
    };
    PipelineState {
        stages: plan_stages(setup.options, setup.handover_level()),
        noise: 0.0,
        dispersion: 1.0,
        solved: frames.clone(),
        frames,
        kappa: Kappa::zeros(),
        free: setup.calibration.free,
        tested: setup.calibration.tested,
        shape: None,
        unseen: UnseenErrors::default(),
        tracking: None,
        solve: None,
        levels: Vec::new(),
        unobservable: Vec::new(),
    }
}
