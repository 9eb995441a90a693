//! The pipeline: the stages of a refinement, one after another.

use crate::persist::checkpoint::Checkpoint;
use crate::progress::Progress;
use crate::refine::error::RefineError;
use crate::refine::inputs::Inputs;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::options::RefineOptions;
use crate::refine::parameters::calibration::Kappa;
use crate::refine::refined::Refined;
use crate::refine::stages::session::Session;
use crate::refine::stages::solve::SolvePlan;
use crate::refine::stages::stage::Stage;
use crate::refine::stages::state::{Estimation, PipelineState};
use crate::survey::Survey;
use std::collections::VecDeque;
use std::sync::Arc;

/// Refines the poses of `survey`.
///
/// The same input gives the same bytes whatever the number of threads.
///
/// # Errors
/// [`RefineError`].
pub fn refine(
    survey: &Survey,
    options: &RefineOptions,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    refine_with_checkpoint(survey, options, None, progress)
}

/// Refines the poses of `survey`, with snapshots kept in a checkpoint; resumes from the snapshot that
/// is in it.
///
/// The result has the same bytes however often the run was interrupted, but for the times that
/// stages took.
///
/// # Errors
/// [`RefineError`].
pub fn refine_with_checkpoint(
    survey: &Survey,
    options: &RefineOptions,
    checkpoint: Option<&mut Checkpoint>,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    let inputs = Inputs::new(survey, options)?;
    let mut session = Session::new(checkpoint, progress);
    let state = session.restore(&inputs)?;
    let mut estimation = Estimation {
        state: state.unwrap_or_else(|| begin(&inputs)),
        solution: None,
        refined: None,
    };
    while let Some(stage) = estimation.state.stages.front().copied() {
        // The solution that the assessment uses is no part of a snapshot.
        if estimation.solution.is_none() {
            session.keep_if_due(&inputs, || estimation.state.clone())?;
        }
        estimation = stage.run(&inputs, estimation, &mut session)?;
        estimation.state.stages.pop_front();
    }
    estimation.refined.ok_or(RefineError::NoOverlap)
}

/// The stages: track coarsely, solve coarse to fine with a check after the first solve and a repair
/// before the last, assess.
fn stages(inputs: &Inputs) -> VecDeque<Stage> {
    let (options, handover) = (inputs.options, inputs.handover_level());
    let mut stages = VecDeque::from([Stage::Prescreen, Stage::Track, Stage::CorrectShading]);
    for level in (0..=handover).rev() {
        let plan = SolvePlan::intermediate(options, level, handover);
        stages.push_back(Stage::Solve(plan));
        if level == handover {
            stages.push_back(Stage::ValidatePairs);
        }
    }
    stages.push_back(Stage::Repair);
    stages.push_back(Stage::Solve(SolvePlan::last(options)));
    if options.joint {
        stages.push_back(Stage::Solve(SolvePlan::joint(options)));
    }
    stages.push_back(Stage::Assess);
    stages
}

/// The state before the first stage.
fn begin(inputs: &Inputs) -> PipelineState {
    let frames = FrameStates {
        estimates: Vec::new(),
        rejections: vec![None; inputs.count()],
        kappa: Kappa::zeros(),
    };
    PipelineState {
        stages: stages(inputs),
        noise: 0.0,
        solved: frames.clone(),
        frames,
        kappa: Kappa::zeros(),
        free: inputs.calibration.free,
        tracking: None,
        solve: None,
        aliases: Vec::new(),
        levels: Vec::new(),
        unobservable: Vec::new(),
    }
}
