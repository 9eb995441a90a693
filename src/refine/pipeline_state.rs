//! What a refinement knows between two of its steps: all that it needs to go on from there.

use crate::frames::Shading;
use crate::persist::checkpoint::{Checkpoint, CheckpointError};
use crate::refine::model::context::Sampling;
use crate::refine::model::frame_states::Tracked;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::parameters::calibration::{Calibration, Kappa, SHARED};
use crate::refine::report::{LevelReport, StageTime};
use crate::refine::solver::gauss_newton::{SolveState, Stopping};
use crate::refine::tracking::alternating_calibration::Retracking;
use crate::refine::uncertainty::observability::Refusal;
use crate::refine::validation::aliasing::Rival;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// A refinement between two steps.
#[derive(Debug, Serialize, Deserialize)]
pub struct RunState {
    /// 1-σ of the sensor's noise, grey levels.
    pub noise: f64,
    /// The shading that frames are divided by.
    pub shading: Option<Shading>,
    /// How far it has come.
    pub phase: Phase,
    /// Stages that are over.
    pub laps: Vec<StageTime>,
    /// Seconds spent on the stage that is not.
    pub lap_s: f64,
}

/// How far a refinement has come.
#[derive(Debug, Serialize, Deserialize)]
pub enum Phase {
    /// Frames are being placed.
    Tracking(Box<Retracking>),
    /// All frames are placed.
    Solving(Box<Solving>),
}

/// Global solves, one after another.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Solving {
    /// The frames.
    pub tracked: Tracked,
    /// The frames as the last solve left them, to see what has changed since.
    pub solved: Tracked,
    /// The shared unknowns, ...
    pub kappa: Kappa,
    /// ... and which of them are still estimated.
    pub free: [bool; SHARED],
    /// Solves that are left.
    pub stages: VecDeque<(Sampling, Stopping)>,
    /// The first of them, if it has begun.
    pub solve: Option<SolveState>,
    /// Whether all frames have been compared pair by pair.
    pub checked: bool,
    /// What the wall's repeats leave undecided, once that has been looked at.
    pub rivals: Option<Vec<Rival>>,
    /// Solves that are over.
    pub levels: Vec<LevelReport>,
    /// Shared unknowns that cannot be estimated.
    pub refusals: Vec<Refusal>,
}

impl Solving {
    /// Before the first solve.
    pub fn begin(
        tracked: Tracked,
        kappa: Kappa,
        calibration: &Calibration,
        stages: impl Iterator<Item = (Sampling, Stopping)>,
    ) -> Self {
        Self {
            solved: tracked.clone(),
            tracked,
            kappa,
            free: calibration.free,
            stages: stages.collect(),
            solve: None,
            checked: false,
            rivals: None,
            levels: Vec::new(),
            refusals: Vec::new(),
        }
    }
}

/// Keeps states where there is a checkpoint, and nothing where there is none.
pub struct Keeper<'a>(pub Option<&'a mut Checkpoint>);

/// Name of the states.
const NAME: &str = "refine";

impl Keeper<'_> {
    /// The state to go on from, if there is one.
    ///
    /// # Errors
    /// [`ProblemError::Checkpoint`] if it is damaged.
    pub fn state(&self) -> Result<Option<RunState>, ProblemError> {
        match &self.0 {
            Some(checkpoint) => Ok(checkpoint.state(NAME)?),
            None => Ok(None),
        }
    }

    /// Keeps the state if it is time.
    ///
    /// # Errors
    /// [`ProblemError::Checkpoint`] with whatever the system says.
    pub fn if_due(&mut self, state: impl FnOnce() -> RunState) -> Result<(), ProblemError> {
        if let Some(checkpoint) = &mut self.0
            && checkpoint.is_due()
        {
            let kept = checkpoint.keep(NAME, &state());
            kept.map_err(CheckpointError::from)?;
        }
        Ok(())
    }
}
