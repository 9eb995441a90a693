//! The course of a solve: its steps, costs, and the curvature that they show.

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
    /// `δᵀ(g' − g)/δᵀHδ`, of the poses' part of the step δ. None of damped steps, and of a last step,
    /// which is not judged.
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
    /// Curvature ([`StepRecord::curvature`]) along the last undamped step that was tried, taken or
    /// not; None if none was.
    pub curvature: Option<f64>,
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

/// Curvature for Gaussian residuals and slopes without error: the mean of `ψ'` over that of `ω`
/// with [`crate::tiles::residual_weighting::Loss`].
const GAUSSIAN_CURVATURE: f64 = 0.89;
/// Curvature of a solve whose last steps showed none: of that, σ are a thousand times those of a
/// good solve, and nothing is believed.
const NO_CURVATURE: f64 = 1e-3;

impl SolveRecord {
    /// Derivative of the gradient over the normal matrix ([`crate::uncertainty::covariance`]) where
    /// the solve ended, as its last undamped step showed.
    ///
    /// It is 1 at the most: weights fall as residuals grow, `ψ' ≤ ω`. Where slopes are noise it is
    /// much less, and a solve comes to an end in steps that hardly change the gradient.
    pub fn curvature(&self) -> f64 {
        let last = self.curvature.unwrap_or(GAUSSIAN_CURVATURE);
        // NaN, too, is none.
        last.min(1.0).max(NO_CURVATURE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(curvature: Option<f64>) -> SolveRecord {
        SolveRecord {
            iterations: 0,
            steps: Vec::new(),
            curvature,
            cost_start: 0.0,
            cost_end: 0.0,
            observations: 0,
            last_step_px: 0.0,
            sigma: 1.0,
            stop: StopReason::StepBelowTolerance,
        }
    }

    #[test]
    fn curvature_is_positive_and_one_at_the_most() {
        let curvature = |last| record(last).curvature();
        assert_eq!(curvature(Some(0.07)), 0.07);
        assert_eq!(curvature(Some(1.4)), 1.0);
        assert_eq!(curvature(None), GAUSSIAN_CURVATURE);
        assert_eq!(
            [-0.4, f64::NAN].map(|last| curvature(Some(last))),
            [NO_CURVATURE; 2]
        );
    }

    /// Means over a Gaussian of unit variance.
    #[test]
    fn the_default_curvature_is_that_of_gaussian_residuals() {
        use crate::tiles::residual_weighting::Loss;
        let (mut weight, mut slope) = (0.0, 0.0);
        for k in -800..=800 {
            let e = 0.01 * f64::from(k);
            let density = (-0.5 * e * e).exp();
            let omega = |e: f64| f64::from(Loss::weight((e * e) as f32, 1.0));
            weight += density * omega(e);
            slope += density * ((e + 0.01) * omega(e + 0.01) - (e - 0.01) * omega(e - 0.01)) / 0.02;
        }
        assert!((slope / weight - GAUSSIAN_CURVATURE).abs() < 0.01);
    }
}
