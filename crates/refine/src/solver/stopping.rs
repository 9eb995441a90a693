//! Stopping rules of a solve, and the reasons for which it stops.

use crate::options::RefineOptions;
use crate::thresholds::stopping::{INTERMEDIATE_STEP_PX, INTERMEDIATE_STEP_SIGMA};
use crate::thresholds::tracking::{MAX_SOLVE_ITERATIONS, STEP_TOLERANCE_PX};
use serde::{Deserialize, Serialize};

/// Stopping rule of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stopping {
    /// Steps at the most.
    pub max_iterations: u64,
    /// A step that moves no wall point by more than this ends the solve, pixels of full size.
    pub step_px: f64,
    /// A step shorter than this share of the estimate's own uncertainty ends the solve:
    /// `√(δᵀHδ / unknowns)`, with H the inverse covariance.
    pub step_sigma: f64,
}

impl Stopping {
    /// The rule of the solves of single frames and windows in tracking; the global solve does the
    /// rest. A step within its own σ tells nothing, and few frames tell little of a camera that is
    /// estimated, too.
    pub const TRACKING: Self = Self {
        max_iterations: MAX_SOLVE_ITERATIONS,
        step_px: STEP_TOLERANCE_PX,
        step_sigma: 1.0,
    };

    /// The rule of a solve at a pyramid level that only brings the estimate close for the next one.
    pub fn intermediate(options: &RefineOptions, level: usize) -> Self {
        Self {
            max_iterations: options.max_iterations,
            step_px: INTERMEDIATE_STEP_PX * 2f64.powi(level as i32),
            step_sigma: INTERMEDIATE_STEP_SIGMA,
        }
    }
}

/// The reason for which a solve stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// The last step moved the wall by less than the tolerance.
    StepBelowTolerance,
    /// The last step was a small share of the estimate's uncertainty.
    StepBelowUncertainty,
    /// No step, however damped, lowers the robust cost any more.
    NoFurtherDescent,
    /// The number of steps allowed was used up.
    MaxIterations,
}

impl StopReason {
    /// True if the last step was short.
    pub fn is_converged(self) -> bool {
        matches!(self, Self::StepBelowTolerance | Self::StepBelowUncertainty)
    }

    /// The reason in words; `last_step_px`: the movement of the wall in the last step.
    pub fn explain(self, stopping: &Stopping, last_step_px: f64) -> String {
        match self {
            Self::StepBelowTolerance => format!(
                "the last step moved no wall point by more than {} px",
                stopping.step_px
            ),
            Self::StepBelowUncertainty => format!(
                "the last step was shorter than {} of the estimate's uncertainty",
                stopping.step_sigma
            ),
            Self::NoFurtherDescent => {
                "no step, however damped, lowers the robust cost any more".to_owned()
            }
            Self::MaxIterations => format!(
                "the {} steps allowed were used up; the last moved the wall by \
                 {last_step_px:.4} px",
                stopping.max_iterations
            ),
        }
    }
}
