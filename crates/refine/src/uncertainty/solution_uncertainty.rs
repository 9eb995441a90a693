//! Uncertainty of a solution: of its poses, and of the shared parameters that it does not observe.

use crate::linear::bordered_system::SharedBlock;
use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::{Calibration, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::solver::gauss_newton::Solution;
use crate::thresholds::observability::MAX_MISFIT_SHARE;
use crate::uncertainty::covariance::{Covariances, NoiseCovariance, compute_covariances};
use crate::uncertainty::frame_sigma::{FrameSigma, compute_frame_sigma};
use crate::uncertainty::model_error::{EstimateErrors, ModelErrorReport};
use crate::uncertainty::observability::{Posterior, UnobservableParameter};
use crate::uncertainty::overdispersion::{Overdispersion, compute_overdispersions};
use crate::uncertainty::registration_sigma::registration_sigmas;

/// The uncertainty of a solution.
pub struct SolutionUncertainty {
    /// Covariances of the poses.
    pub covariances: Covariances,
    /// 1-σ of every frame against the wall that the others show, pixels.
    pub registration_px: Vec<f64>,
    /// Errors beyond noise, if the residuals show any.
    pub model_error: Option<ModelErrorReport>,
    /// Covariance `Σ_κ` of the shared parameters, where they were estimated.
    pub shared: Option<SharedBlock>,
    /// Overdispersion of every frame; 0 for those that show nothing.
    pub overdispersions: Vec<Overdispersion>,
    posterior: Option<Posterior>,
}

impl SolutionUncertainty {
    /// Computes the uncertainty of a solution, with the free parameters of `calibration`;
    /// `context`: with the solution's own κ; `alpha`: rate of false alarms.
    ///
    /// # Errors
    /// [`ProblemError::Factor`] if shared parameters were estimated and the poses' normal matrix is
    /// singular.
    pub fn at(
        context: &EstimationContext,
        solution: &Solution,
        calibration: &Calibration,
        alpha: f64,
    ) -> Result<Self, ProblemError> {
        let problem = &solution.problem;
        let posterior = Posterior::at(solution).map_err(|source| problem.factor_error(source))?;
        let of_free = |posterior: &Posterior| posterior.covariance(&calibration.free);
        let mut shared = posterior.as_ref().and_then(of_free);
        let (prior, _) = problem.prior_information(&solution.estimates, &solution.kappa);
        let of_noise = compute_covariances(
            problem.pattern(),
            &solution.linearisation.normal,
            problem.constrained_gauge_freedoms(),
            &solution.linearisation.scatter,
            &prior,
            solution.record.curvature(),
        );
        // Poses without a covariance still count; they are reported as uncertain.
        let mut patches = None;
        let (covariances, dispersion) = match of_noise {
            Ok(of_noise) => {
                let errors = EstimateErrors::find(solution, posterior.as_ref(), &of_noise, alpha)?;
                let of_shared = posterior.as_ref().zip(shared.as_ref());
                let covariances = total(&of_noise, errors.as_ref(), of_shared);
                if let (Some(shared), Some(errors)) = (&mut shared, &errors) {
                    *shared += errors.draws.of_shared();
                }
                patches = errors.and_then(|errors| errors.patches);
                let of_patches = patches.map(|patches| patches.dispersion);
                (covariances, of_patches.unwrap_or(of_noise.pixel_dispersion))
            }
            Err(_) => (Covariances::unknown(solution.estimates.len()), f64::NAN),
        };
        Ok(Self {
            covariances,
            registration_px: registration_sigmas(context, solution, dispersion),
            model_error: patches.map(|found| ModelErrorReport::new(&found, problem)),
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
                context.surface.as_ref(),
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
        max_sigma_px: f64,
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
        if median.is_nan() || median > max_sigma_px {
            let reason = format!(
                "the frames are certain to {median:.2} px of the wall only (1-σ), and more than \
                 {max_sigma_px} px leave the camera to chance; use more frames, best a \
                 whole turn or two, or more of a wall with texture"
            );
            return mark_all_unobservable(calibration, &reason);
        }
        posterior.find_unobservable(calibration)
    }
}

/// The covariance of all errors ([`crate::uncertainty::covariance`],
/// [`crate::uncertainty::model_error`]).
fn total(
    of_noise: &NoiseCovariance,
    errors: Option<&EstimateErrors>,
    shared: Option<(&Posterior, &SharedBlock)>,
) -> Covariances {
    let c = of_noise.pixel_dispersion;
    let poses = match errors {
        // Draws of patches include those of the shared parameters.
        Some(errors) if errors.patches.is_some() => {
            return of_noise.map(|j, k, _| errors.draws.of_pair(j, k));
        }
        Some(errors) => {
            of_noise.map(|j, k, inverse| inverse * c + errors.draws.of_pair(j, k) * (1.0 - c))
        }
        None => of_noise.map(|_, _, inverse| inverse * c),
    };
    match shared {
        Some((posterior, covariance)) => poses.with_shared(&posterior.w, covariance),
        None => poses,
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
