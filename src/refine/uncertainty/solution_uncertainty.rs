//! How sure a solution is, and what of the shared unknowns it does not tell.

use crate::refine::linear::bordered_system::SharedBlock;
use crate::refine::model::context::EstimationContext;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::RejectionReason;
use crate::refine::parameters::calibration::{Calibration, SHARED_PARAMETERS};
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::solver::gauss_newton::Solution;
use crate::refine::uncertainty::covariance::{Covariances, FrameSigma, covariances, frame_sigma};
use crate::refine::uncertainty::observability::{Posterior, UnobservableParameter};
use crate::refine::uncertainty::overdispersion::{Overdispersion, overdispersed, overdispersions};

/// Share of frames that may fit nowhere before nothing is believed about what all frames share: the
/// others may fit each other in wrong places.
const MOST_MISFITS: f64 = 0.1;
/// 1-σ of the median frame on the wall, pixels, beyond which nothing is believed about what all
/// frames share. Frames tied so loosely can tilt and shift together, the camera with them, for less
/// than aliasing does; that is more than the covariance knows of.
const MOST_LOOSE_PX: f64 = 0.2;

/// The covariance of a solution.
pub struct SolutionUncertainty {
    /// Of the poses.
    pub covariances: Covariances,
    /// `Σ_κ`, where it was estimated.
    pub shared: Option<SharedBlock>,
    /// Each frame's overdispersion; none of those that show nothing.
    pub overdispersions: Vec<Overdispersion>,
    posterior: Option<Posterior>,
}

impl SolutionUncertainty {
    /// At a solution, for the free unknowns of `calibration`; `scene`: with the solution's own κ.
    ///
    /// # Errors
    /// [`ProblemError::Factor`] if shared unknowns were estimated and the poses' normal matrix is
    /// singular.
    pub fn at(
        scene: &EstimationContext,
        solution: &Solution,
        calibration: &Calibration,
    ) -> Result<Self, ProblemError> {
        let problem = &solution.problem;
        let posterior = Posterior::at(solution).map_err(|source| problem.factor_error(source))?;
        let of_free = |posterior: &Posterior| posterior.covariance(&calibration.free);
        let shared = posterior.as_ref().and_then(of_free);
        let (prior, _) = problem.prior_information(&solution.estimates, &solution.kappa);
        let found = covariances(
            problem.pattern(),
            &solution.linearisation.normal,
            problem.constrained_gauge_freedoms(),
            &solution.linearisation.scatter,
            &prior,
            solution.record.curvature(),
        );
        // Poses without a covariance are still poses; they are reported as uncertain.
        let mut covariances =
            found.unwrap_or_else(|_| Covariances::unknown(solution.estimates.len()));
        if let (Some(posterior), Some(shared)) = (&posterior, &shared) {
            covariances = covariances.with_shared(&posterior.w, shared);
        }
        Ok(Self {
            covariances,
            shared,
            overdispersions: overdispersions(scene, solution),
            posterior,
        })
    }

    /// 1-σ of frame `k`.
    pub fn of_frame(
        &self,
        scene: &EstimationContext,
        k: usize,
        estimate: &FrameEstimate,
    ) -> FrameSigma {
        let w = self.posterior.as_ref().map(|posterior| &posterior.w[k]);
        frame_sigma(
            scene.surface,
            &scene.camera,
            estimate,
            &self.covariances.frames[k],
            w.zip(self.shared.as_ref()),
        )
    }

    /// The rejections with those about frames whose residuals are no noise.
    pub fn with_overdispersion(
        &self,
        mut rejections: Vec<Option<RejectionReason>>,
    ) -> Vec<Option<RejectionReason>> {
        let overdispersed = overdispersed(&self.overdispersions, &rejections);
        for ((rejection, overdispersed), overdispersion) in rejections
            .iter_mut()
            .zip(overdispersed)
            .zip(&self.overdispersions)
        {
            if overdispersed {
                *rejection = Some(RejectionReason::Overdispersed {
                    overdispersion_px: overdispersion.px,
                });
            }
        }
        rejections
    }

    /// The shared unknowns that the data do not observe: all, where too many frames do not fit the
    /// others, or only under overdispersion, or where all are tied too loosely. `scene`: with the
    /// solution's own κ.
    pub fn unobservable(
        &self,
        scene: &EstimationContext,
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
        let (wrong, count) = (misfits.count(), rejections.len());
        if wrong as f64 > MOST_MISFITS * count as f64 {
            let reason = format!(
                "{wrong} of {count} frames do not fit the others, so the rest may fit in wrong places; give better poses or \
                 a better calibration, or estimate less at once"
            );
            return refuse_all(calibration, &reason);
        }
        let overdispersed = overdispersed(&self.overdispersions, rejections);
        let sure = (0..count).filter(|k| rejections[*k].is_none() && !overdispersed[*k]);
        let sure: Vec<usize> = sure.collect();
        if sure.is_empty() && overdispersed.contains(&true) {
            let reason = "the frames fit each other only under overdispersion: a wall that repeats and is closed a period off, a wrong shape, \
                          or what is not estimated";
            return refuse_all(calibration, reason);
        }
        let sigmas = sure
            .into_iter()
            .map(|k| self.of_frame(scene, k, &estimates[k]).wall_px);
        let mut sigmas: Vec<f64> = sigmas.collect();
        sigmas.sort_unstable_by(f64::total_cmp);
        let usual = sigmas.get(sigmas.len() / 2).copied().unwrap_or(f64::NAN);
        if usual.is_nan() || usual > MOST_LOOSE_PX {
            let reason = format!(
                "the frames tie each other to {usual:.2} px of the wall only (1-σ), and more than {MOST_LOOSE_PX} px leave the \
                 camera to chance; use more frames, best a whole turn or two, or more of a wall with texture"
            );
            return refuse_all(calibration, &reason);
        }
        posterior.find_unobservable(calibration)
    }
}

/// Refuses every free unknown.
fn refuse_all(calibration: &Calibration, reason: &str) -> Vec<UnobservableParameter> {
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
    use crate::camera::Camera;
    use crate::refine::parameters::calibration::Kappa;

    #[test]
    fn all_that_was_asked_for_is_refused() {
        let mut calibration = Calibration::none(&Camera::from_vertical_fov(160, 120, 1.0));
        calibration.sigma = Kappa::repeat(0.1);
        calibration.free[3] = true;
        let unobservable = refuse_all(&calibration, "because");
        assert_eq!(unobservable.len(), 1);
        assert_eq!((unobservable[0].unknown, unobservable[0].sigma), (3, 0.1));
    }
}
