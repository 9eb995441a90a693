//! The course of a solve: its steps, costs, and the curvature along them.

use crate::solver::stopping::StopReason;
use serde::{Deserialize, Serialize};

/// One step of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StepRecord {
    /// Robust cost after it, on the same wall samples as at the start; None after a last step,
    /// which is not judged.
    pub cost: Option<f64>,
    /// Largest movement of the wall, pixels of full size.
    pub step_px: f64,
    /// λ with which it was taken; 0 is plain Gauss–Newton.
    pub damping: f64,
    /// Change of the gradient along the step, over what the normal equations predict:
    /// `δᵀ(g' − g)/δᵀHδ`, of the poses' part of the step δ. None where it was not looked at.
    pub curvature: Option<f64>,
}

/// The course of one solve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SolveRecord {
    /// Number of steps taken.
    pub iterations: u64,
    /// The steps.
    pub steps: Vec<StepRecord>,
    /// Robust cost at the start.
    pub cost_start: f64,
    /// Robust cost at the end, on the same wall samples, before the last step.
    pub cost_end: f64,
    /// Observations (wall sample × frame) compared.
    pub observations: usize,
    /// Largest movement of the wall in the last step, pixels of full size.
    pub last_step_px: f64,
    /// Noise of a pixel assumed, grey levels.
    pub sigma: f64,
    /// The reason for which it stopped.
    pub stop: StopReason,
}
