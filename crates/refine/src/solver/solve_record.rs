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
    /// `δᵀ(g' − g)/δᵀHδ`, of the poses' part of the step δ. None where it was not looked at: after
    /// a last step, and where frames were held.
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

/// Curvature for Gaussian residuals and slopes without error: the mean of `ψ'` over that of `ω`
/// with [`crate::tiles::residual_weighting::Loss`].
const GAUSSIAN_CURVATURE: f64 = 0.89;
/// Curvature of a solve whose last steps showed none: of that, σ are a thousand times those of a
/// good solve, and nothing is believed.
const NO_CURVATURE: f64 = 1e-3;

impl SolveRecord {
    /// Derivative of the gradient over the normal matrix ([`crate::uncertainty::covariance`]), as
    /// the last step showed that was looked at.
    ///
    /// It is 1 at the most: weights fall as residuals grow, `ψ' ≤ ω`. Where slopes are noise it is
    /// much less, and a solve comes to an end in steps that hardly change the gradient.
    pub fn curvature(&self) -> f64 {
        let last = self.steps.iter().rev().find_map(|step| step.curvature);
        let last = last.unwrap_or(GAUSSIAN_CURVATURE);
        // NaN, too, is none.
        last.min(1.0).max(NO_CURVATURE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(steps: &[(f64, Option<f64>)]) -> SolveRecord {
        let steps = steps.iter().map(|(step_px, curvature)| StepRecord {
            cost: None,
            step_px: *step_px,
            damping: 0.0,
            curvature: *curvature,
        });
        SolveRecord {
            iterations: 0,
            steps: steps.collect(),
            cost_start: 0.0,
            cost_end: 0.0,
            observations: 0,
            last_step_px: 0.0,
            sigma: 1.0,
            stop: StopReason::StepBelowTolerance,
        }
    }

    #[test]
    fn the_last_step_that_was_looked_at_counts() {
        assert_eq!(
            record(&[(0.2, Some(0.9)), (0.1, Some(0.07)), (0.05, None)]).curvature(),
            0.07
        );
        assert_eq!(record(&[(0.05, None)]).curvature(), GAUSSIAN_CURVATURE);
        assert_eq!(record(&[(3.0, Some(1.4))]).curvature(), 1.0);
        for none in [-0.4, f64::NAN] {
            assert_eq!(record(&[(0.3, Some(none))]).curvature(), NO_CURVATURE);
        }
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
