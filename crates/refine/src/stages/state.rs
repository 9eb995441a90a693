//! The state of a refinement between two stages: everything that it takes to resume from there.

use crate::model::frame_states::FrameStates;
use crate::parameters::calibration::{Kappa, SHARED_PARAMETERS};
use crate::parameters::shape::Shape;
use crate::parameters::unseen_errors::UnseenErrors;
use crate::refined::Refined;
use crate::report::{LevelReport, StageTime};
use crate::solver::gauss_newton::{Solution, SolveState};
use crate::solver::solve_record::SolveRecord;
use crate::solver::stopping::Stopping;
use crate::stages::plan::Stage;
use crate::tracking::alternating_calibration::AlternatingCalibration;
use crate::uncertainty::observability::UnobservableParameter;
use crate::uncertainty::solution_uncertainty::SolutionUncertainty;
use crate::verdict::other_readings::OtherReadings;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use tunnelstitch_core::frames::{Light, PictureNoise};

/// The part of a refinement's state that a checkpoint keeps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PipelineState {
    /// Stages that are left; the first is the next, or the one under way.
    pub stages: VecDeque<Stage>,
    /// Stages that are over.
    pub over: Vec<Stage>,
    /// The noise of the pictures.
    pub noise: PictureNoise,
    /// False if the light has turned out to be no shading that all frames have in common.
    pub has_common_light: bool,
    /// True if most frames did not fit in the light of a lamp.
    pub is_lamp_ruled_out: bool,
    /// Other readings of the survey, once they are compared.
    pub readings: OtherReadings,
    /// Dispersion of the residuals ([`crate::uncertainty::model_error`]), once it is known.
    pub dispersion: f64,
    /// The frames: estimates (none before they are tracked) and rejection reasons.
    pub frames: FrameStates,
    /// The shared parameters κ, ...
    pub kappa: Kappa,
    /// ... and which of them are still estimated.
    pub free: [bool; SHARED_PARAMETERS],
    /// Those that are tested for whether they should be.
    pub tested: [bool; SHARED_PARAMETERS],
    /// The wall's shape, if it is estimated, from the first solve at full size on.
    pub shape: Option<Shape>,
    /// Errors by deformation of the wall that is not seen.
    pub unseen: UnseenErrors,
    /// Tracking, if it is under way.
    pub tracking: Option<AlternatingCalibration>,
    /// The global solve that is under way.
    pub solve: Option<SolveState>,
    /// Global solves that are over.
    pub levels: Vec<GlobalSolve>,
    /// Shared parameters that the data do not observe.
    pub unobservable: Vec<UnobservableParameter>,
}

/// One global solve that is over.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GlobalSolve {
    /// Wall samples per pixel along each axis.
    pub samples_per_pixel: f64,
    /// Pyramid level of the pixels.
    pub level: usize,
    /// True if the wall was solved for jointly with the poses.
    pub joint: bool,
    /// Its course.
    pub record: SolveRecord,
}

impl From<GlobalSolve> for LevelReport {
    fn from(solve: GlobalSolve) -> Self {
        Self {
            samples_per_pixel: solve.samples_per_pixel,
            level: solve.level,
            joint: solve.joint,
            solve: solve.record,
        }
    }
}

/// A checkpoint of a refinement: its state, and what lies beside it.
#[derive(Debug, Serialize, Deserialize)]
pub struct Snapshot {
    /// The state.
    pub state: PipelineState,
    /// Treatment of the frames' light.
    pub light: Light,
    /// Bands along the tunnel that are left out: angles θ from and to, radians.
    pub hidden_bands: Vec<[f64; 2]>,
    /// Stages that are over, with their times.
    pub timings: Vec<StageTime>,
    /// Seconds spent on the stage under way.
    pub elapsed_s: f64,
}

/// The last full-size solve.
pub struct LastSolve<'a> {
    /// The solution.
    pub solution: Solution<'a>,
    /// Its uncertainty.
    pub uncertainty: SolutionUncertainty,
    /// The stopping rule.
    pub stopping: Stopping,
}

impl Estimation<'_> {
    /// A refinement that goes on from a state.
    pub fn new(state: PipelineState) -> Self {
        Self {
            state,
            hidden_bands: None,
            solution: None,
            refined: None,
        }
    }

    /// The refinement with its first stage over.
    pub fn without_first_stage(mut self) -> Self {
        let first = self.state.stages.pop_front();
        self.state.over.extend(first);
        self
    }
}

/// A refinement between two stages.
pub struct Estimation<'a> {
    /// The state.
    pub state: PipelineState,
    /// All bands along the tunnel that are hidden, angles θ from and to, radians, if the last solve
    /// has found more of them: then all is to be done again without them.
    pub hidden_bands: Option<Vec<[f64; 2]>>,
    /// The last full-size solve. It is held in memory only; no checkpoint is kept between it and
    /// the assessment that uses it.
    pub solution: Option<LastSolve<'a>>,
    /// The result, once assessed.
    pub refined: Option<Refined>,
}
