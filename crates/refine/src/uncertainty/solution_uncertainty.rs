//! Uncertainty of a solution: of its poses, and of the shared parameters that it does not observe.

use crate::linear::bordered_system::SharedBlock;
use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::{Calibration, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::solver::gauss_newton::Solution;
use crate::thresholds::observability::{MAX_MEDIAN_SIGMA_PX, MAX_MISFIT_SHARE};
use crate::uncertainty::covariance::{Covariances, compute_covariances};
use crate::uncertainty::frame_sigma::{FrameSigma, compute_frame_sigma};
use crate::uncertainty::model_error::{ModelError, ModelErrorReport};
use crate::uncertainty::observability::{Posterior, UnobservableParameter};
use crate::uncertainty::registration_sigma::registration_sigmas;
use crate::uncertainty::overdispersion::{Overdispersion, compute_overdispersions};

/// The uncertainty of a solution.
pub struct SolutionUncertainty {
    /// Covariances of the poses.
    pub covariances: Covariances,
    /// 1-σ of every frame against those that show the same wall, pixels.
    pub registration_px: Vec<f64>,
    /// What the residuals show beyond noise, if they do.
    pub model_error: Option<ModelErrorReport>,
    /// Covariance `Σ_κ` of the shared parameters, where they were estimated.
    pub shared: Option<SharedBlock>,
    /// Overdispersion of every frame; 0 for those that show nothing.
    pub overdispersions: Vec<Overdispersion>,
    posterior: Option<Posterior>,
}

impl SolutionUncertainty {
    /// Computes the uncertainty of a solution, with the free parameters of `calibration`;
    /// `context`: with the solution's own κ.
    ///
    /// # Errors
    /// [`ProblemError::Factor`] if shared parameters were estimated and the poses' normal matrix is
    /// singular.
    pub fn at(
        context: &EstimationContext,
        solution: &Solution,
        calibration: &Calibration,
    ) -> Result<Self, ProblemError> {
        let problem = &solution.problem;
        let posterior = Posterior::at(solution).map_err(|source| problem.factor_error(source))?;
        let of_free = |posterior: &Posterior| posterior.covariance(&calibration.free);
        let mut shared = posterior.as_ref().and_then(of_free);
        let (prior, _) = problem.prior_information(&solution.estimates, &solution.kappa);
        let pattern = problem.pattern();
        let of_noise = compute_covariances(
            pattern,
            &solution.linearisation.normal,
            problem.constrained_gauge_freedoms(),
            &solution.linearisation.scatter,
            &prior,
            solution.record.curvature(),
        );
        // Poses without a covariance still count; they are reported as uncertain.
        let (mut pairs, mut model_error) = (None, None);
        if let Ok(of_noise) = of_noise {
            model_error = ModelError::find(solution, posterior.as_ref(), of_noise.pixel_dispersion)?;
            pairs = Some(match (&model_error, &posterior, &shared) {
                // Its draws include the shared parameters.
                (Some(model_error), ..) => {
                    of_noise.replaced(pattern, |j, k| model_error.of_pair(j, k))
                }
                (None, Some(posterior), Some(shared)) => {
                    of_noise.with_shared(pattern, &posterior.w, shared)
                }
                _ => of_noise,
            });
        }
        if let (Some(shared), Some(model_error)) = (&mut shared, &model_error) {
            *shared += model_error.of_shared();
        }
        let covariances = match &pairs {
            Some(pairs) => pairs.covariances(pattern),
            None => Covariances::unknown(solution.estimates.len()),
        };
        let registration_px = match &pairs {
            Some(pairs) => registration_sigmas(context, pattern, pairs, &solution.estimates),
            None => vec![f64::NAN; solution.estimates.len()],
        };
        Ok(Self {
            covariances,
            registration_px,
            model_error: model_error.map(|found| ModelErrorReport::new(&found, problem)),
            shared,
            overdispersions: compute_overdispersions(context, solution),
            posterior,
        })
    }

    /// Computes 1-σ of frame `k` at its estimate.
    pub fn frame_sigma(
        &self,
        context: &EstimationContext,
        k: usize,
        estimate: &FrameEstimate,
    ) -> FrameSigma {
        let w = self.posterior.as_ref().map(|posterior| &posterior.w[k]);
        FrameSigma {
            registration_px: self.registration_px[k],
            ..compute_frame_sigma(
                context.surface,
                &context.camera,
                estimate,
                &self.covariances.frames[k],
                w.zip(self.shared.as_ref()),
            )
        }
    }

    /// Finds the shared parameters that the data do not observe. All are unobservable if too many
    /// frames do not fit the others, or if they are tied too loosely.
    /// `context`: with the solution's own κ.
    pub fn find_unobservable(
        &self,
        context: &EstimationContext,
        calibration: &Calibration,
        estimates: &[FrameEstimate],
        rejections: &[Option<RejectionReason>],
    ) -> Vec<UnobservableParameter> {
        let Some(posterior) = &self.posterior else {
            return Vec::new();
        };
        let misfits = rejections
            .iter()
            .flatten()
            .filter(|rejection| rejection.is_misfit());
        let (misfits, count) = (misfits.count(), rejections.len());
        if misfits as f64 > MAX_MISFIT_SHARE * count as f64 {
            let reason = format!(
                "{misfits} of {count} frames do not fit the others, so the rest may fit in wrong \
                 places; give better poses or a better calibration, or estimate less at once"
            );
            return mark_all_unobservable(calibration, &reason);
        }
        let sigmas = (0..count)
            .filter(|k| rejections[*k].is_none())
            .map(|k| self.frame_sigma(context, k, &estimates[k]).wall_px);
        let mut sigmas: Vec<f64> = sigmas.collect();
        sigmas.sort_unstable_by(f64::total_cmp);
        let median = sigmas.get(sigmas.len() / 2).copied().unwrap_or(f64::NAN);
        if median.is_nan() || median > MAX_MEDIAN_SIGMA_PX {
            let reason = format!(
                "the frames tie each other to {median:.2} px of the wall only (1-σ), and more than \
                 {MAX_MEDIAN_SIGMA_PX} px leave the camera to chance; use more frames, best a \
                 whole turn or two, or more of a wall with texture"
            );
            return mark_all_unobservable(calibration, &reason);
        }
        posterior.find_unobservable(calibration)
    }
}

/// Marks every free parameter as unobservable.
fn mark_all_unobservable(calibration: &Calibration, reason: &str) -> Vec<UnobservableParameter> {
    let free = (0..SHARED_PARAMETERS).filter(|k| calibration.free[*k]);
    free.map(|unknown| UnobservableParameter {
        unknown,
        sigma: calibration.sigma[unknown],
        reason: reason.to_owned(),
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::calibration::Kappa;
    use tunnelstitch_geometry::camera::Camera;

    #[test]
    fn all_free_parameters_are_marked() {
        let mut calibration = Calibration::none(&Camera::from_vertical_fov(160, 120, 1.0));
        calibration.sigma = Kappa::repeat(0.1);
        calibration.free[3] = true;
        let unobservable = mark_all_unobservable(&calibration, "because");
        assert_eq!(unobservable.len(), 1);
        assert_eq!((unobservable[0].unknown, unobservable[0].sigma), (3, 0.1));
    }
}
