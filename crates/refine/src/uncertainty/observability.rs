//! Observability of the shared parameters.
//!
//! After a solve, `Σ_κ` ([`crate::linear::bordered_system`]) is the covariance of the free
//! shared parameters. One that is hardly more certain than by its prior is unobservable: it is held
//! at the value given, and the others are solved without it. The worst is held first, for without
//! it another may be observed.

use crate::linear::bordered_system::{BorderBlock, SchurComplement, SharedBlock, reduce_to_shared};
use crate::linear::sparse_cholesky::Factor;
use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::{Calibration, Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use crate::parameters::unknowns::Unknowns;
use crate::problem::linearisation::Linearisation;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::problem::score_scatter::ScoreScatter;
use crate::thresholds::observability::MAX_SIGMA_SHARE;
use crate::uncertainty::observed_curvature::{ObservedCurvature, observe_curvature};
use crate::uncertainty::shared_parameter_names::{PARAMETERS, ParameterKind};
use nalgebra::{DMatrix, SMatrix};
use serde::{Deserialize, Serialize};

/// Correlation with another parameter from which on it is reported: without the other, 1-σ is less
/// than half, `√(1 − r²)` of it.
const MIN_REPORTED_CORRELATION: f64 = 0.87;

/// A shared parameter that was to be estimated and cannot be observed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnobservableParameter {
    /// Its index in κ.
    pub unknown: usize,
    /// 1-σ if it were estimated.
    pub sigma: f64,
    /// The reason, for the report.
    pub reason: String,
}

/// The reduced normal equations of κ at a solution.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// `W = H_pp⁻¹ H_pκ`, one block per frame.
    pub w: Vec<BorderBlock>,
    /// Schur complement S.
    schur: SharedBlock,
    /// `E Q Eᵀ`, over the square of the score's curvature
    /// ([`crate::uncertainty::covariance`]).
    scatter: SharedBlock,
}

impl Posterior {
    /// Observes the curvature κ ([`crate::uncertainty::observed_curvature`]) at a solution and
    /// eliminates the poses: κ, the posterior if a shared parameter was estimated, and the factor
    /// of the normal matrix. Where that is singular and none was, nothing is known of the poses,
    /// and κ is 1. `at`: the equations at the unknowns `from`, within a step of the solution's
    /// `unknowns`.
    ///
    /// # Errors
    /// [`ProblemError::Factor`] if shared parameters were estimated and the poses' normal matrix is
    /// singular; a frame that has to be read again and cannot be.
    pub fn with_curvature<'s>(
        problem: &PhotometricProblem,
        (at, from): (&'s Linearisation, &Unknowns),
        unknowns: &Unknowns,
        scatter: &ScoreScatter,
    ) -> Result<(ObservedCurvature, Option<Self>, Option<Factor<'s>>), ProblemError> {
        let borders = at.border.as_ref().zip(scatter.border.as_ref());
        let pattern = problem.pattern();
        let factor = match problem.symbolic().factorise(&at.normal, 0.0) {
            Ok(factor) => factor,
            Err(_) if borders.is_none() => {
                return Ok((ObservedCurvature::AS_PREDICTED, None, None));
            }
            Err(source) => return Err(problem.factor_error(source)),
        };
        let curvature = observe_curvature(problem, (at, from), &factor, &scatter.signed)?;
        let posterior = borders.map(|(border, border_scatter)| {
            let SchurComplement { w, schur } = border.eliminate(&factor, 0.0);
            let others = problem.other_information(unknowns);
            let scatter = (reduce_to_shared(pattern, &scatter.blocks, border_scatter, &w)
                + reduce_to_shared(&others.pattern, &others.blocks, &others.border, &w))
                / curvature.effective().powi(2);
            Self { w, schur, scatter }
        });
        Ok((curvature, posterior, Some(factor)))
    }

    /// Covariance `Σ_κ` of the `free` parameters, zero elsewhere; None if S is singular.
    pub fn covariance(&self, free: &[bool; SHARED_PARAMETERS]) -> Option<SharedBlock> {
        let places: Vec<usize> = (0..SHARED_PARAMETERS).filter(|k| free[*k]).collect();
        let n = places.len();
        let part = |of: &SharedBlock| DMatrix::from_fn(n, n, |r, c| of[(places[r], places[c])]);
        let inverse = part(&self.schur).cholesky()?.inverse();
        let small = &inverse * part(&self.scatter) * &inverse;
        let mut covariance = SharedBlock::zeros();
        for (r, row) in places.iter().enumerate() {
            for (c, column) in places.iter().enumerate() {
                covariance[(*row, *column)] = small[(r, c)];
            }
        }
        Some(covariance)
    }

    /// Steps `S⁻¹ (z_κ − Wᵀ z_p)` of the shared parameters for right sides of the frames and of
    /// these parameters, a column each; zero if S is singular.
    pub fn steps_of_shared<const C: usize>(
        &self,
        z: &[SMatrix<f64, FRAME_PARAMETERS, C>],
        z_shared: &SMatrix<f64, SHARED_PARAMETERS, C>,
    ) -> SMatrix<f64, SHARED_PARAMETERS, C> {
        let mut reduced = *z_shared;
        for (w, z) in self.w.iter().zip(z) {
            reduced -= w.transpose() * z;
        }
        match self.schur.cholesky() {
            Some(schur) => schur.solve(&reduced),
            None => SMatrix::zeros(),
        }
    }

    /// Finds the parameters that the data do not observe, one by one, the worst first. If S is
    /// singular, none is observed.
    pub fn find_unobservable(&self, calibration: &Calibration) -> Vec<UnobservableParameter> {
        let mut free = calibration.free;
        let mut unobservable = Vec::new();
        while free.contains(&true) {
            let covariance = self
                .covariance(&free)
                .unwrap_or_else(|| SharedBlock::from_diagonal(&Kappa::repeat(f64::INFINITY)));
            let share = |k: usize| covariance[(k, k)].sqrt() / calibration.sigma[k];
            let worst = (0..SHARED_PARAMETERS)
                .filter(|k| free[*k])
                .max_by(|a, b| share(*a).total_cmp(&share(*b)));
            let Some(worst) = worst.filter(|k| share(*k).is_nan() || share(*k) > MAX_SIGMA_SHARE)
            else {
                break;
            };
            // Whatever the scatter, it is not larger than the prior's.
            let sigma = covariance[(worst, worst)].sqrt();
            unobservable.push(UnobservableParameter {
                unknown: worst,
                sigma: sigma.min(calibration.sigma[worst]),
                reason: explain(worst, &covariance, &free),
            });
            free[worst] = false;
        }
        unobservable
    }
}

/// States why a parameter is not observed, with a parameter that it is correlated with.
fn explain(unknown: usize, covariance: &SharedBlock, free: &[bool; SHARED_PARAMETERS]) -> String {
    let mut reason = match PARAMETERS[unknown].1 {
        ParameterKind::Radius => {
            "pictures stay the same when the radius and all positions grow together, and the \
             steps of the initial poses are not sure enough to tell metres; measure the radius, \
             or give poses with smaller [prior] translation_sigma_m"
        }
        ParameterKind::Tilt | ParameterKind::Offset => {
            "pictures show how the cameras stand in the tunnel, whatever the frame of the initial \
             poses; only these poses themselves can tell, and they are not sure enough"
        }
        ParameterKind::Focal
        | ParameterKind::Pixel
        | ParameterKind::Plain
        | ParameterKind::Time
        | ParameterKind::Curvature => {
            "the frames leave it nearly as uncertain as it was: too little overlap, texture, or \
             width of view"
        }
    }
    .to_owned();
    let correlation = |k: usize| {
        let variances = covariance[(k, k)] * covariance[(unknown, unknown)];
        covariance[(unknown, k)] / variances.sqrt()
    };
    let twin = (0..SHARED_PARAMETERS)
        .filter(|k| *k != unknown && free[*k])
        .map(|k| (k, correlation(k)))
        .filter(|(_, r)| r.is_finite() && r.abs() > MIN_REPORTED_CORRELATION)
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    if let Some((twin, r)) = twin {
        reason += &format!(
            "; it goes with {} (correlation {r:.3}): estimate one of the two",
            PARAMETERS[twin].0
        );
    }
    reason
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::Camera;

    fn calibration() -> Calibration {
        Calibration {
            free: [true; SHARED_PARAMETERS],
            sigma: Kappa::repeat(0.1),
            ..Calibration::none(Camera::from_vertical_fov(160, 120, 1.0))
        }
    }

    /// The posterior where the scatter is as modelled.
    fn posterior(schur: SharedBlock) -> Posterior {
        Posterior {
            w: Vec::new(),
            schur,
            scatter: schur,
        }
    }

    #[test]
    fn parameter_known_by_the_prior_alone_is_unobservable() {
        // The prior's information is 100.
        let mut schur = SharedBlock::identity() * 1e4;
        schur[(5, 5)] = 110.0;
        let unobservable = posterior(schur).find_unobservable(&calibration());
        assert_eq!(unobservable.len(), 1);
        assert_eq!(unobservable[0].unknown, 5);
        assert!((unobservable[0].sigma - 110f64.powf(-0.5)).abs() < 1e-12);
        assert!(unobservable[0].reason.contains("radius"));
        let certain = posterior(SharedBlock::identity() * 1e4);
        assert!(certain.find_unobservable(&calibration()).is_empty());
    }

    /// Of two parameters of which the data observe only the sum, one is unobservable.
    #[test]
    fn one_of_two_correlated_parameters_is_unobservable() {
        let mut schur = SharedBlock::identity() * 1e4;
        for (r, c) in [(3, 3), (3, 4), (4, 3), (4, 4)] {
            schur[(r, c)] = 1e6 + if r == c { 100.0 } else { 0.0 };
        }
        let unobservable = posterior(schur).find_unobservable(&calibration());
        assert_eq!(unobservable.len(), 1);
        assert!([3, 4].contains(&unobservable[0].unknown));
        assert!(
            unobservable[0].reason.contains("goes with k"),
            "{}",
            unobservable[0].reason
        );
    }
}
