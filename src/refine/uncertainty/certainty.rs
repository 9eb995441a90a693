//! How sure a solution is, and what of the shared unknowns it does not tell.

use crate::refine::linear::bordered_system::SharedBlock;
use crate::refine::model::context::Scene;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::Doubt;
use crate::refine::parameters::calibration::{Calibration, SHARED};
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::solver::gauss_newton::Solution;
use crate::refine::uncertainty::covariance::{Covariances, FrameSigma, covariances, frame_sigma};
use crate::refine::uncertainty::observability::{Posterior, Refusal};
use crate::refine::uncertainty::overdispersion::{Strain, strained, strains};

/// Share of frames that may fit nowhere before nothing is believed about what all frames share: the
/// others may fit each other in wrong places.
const MOST_MISFITS: f64 = 0.1;
/// 1-σ of the median frame on the wall, pixels, beyond which nothing is believed about what all
/// frames share. Frames tied so loosely can tilt and shift together, the camera with them, for less
/// than aliasing does; that is more than the covariance knows of.
const MOST_LOOSE_PX: f64 = 0.2;

/// The covariance of a solution.
pub struct Certainty {
    /// Of the poses.
    pub covariances: Covariances,
    /// `Σ_κ`, where it was estimated.
    pub shared: Option<SharedBlock>,
    /// Each frame's strain; none of those that show nothing.
    pub strains: Vec<Strain>,
    posterior: Option<Posterior>,
}

impl Certainty {
    /// At a solution, for the free unknowns of `calibration`; `scene`: with the solution's own κ.
    ///
    /// # Errors
    /// [`ProblemError::Factor`] if shared unknowns were estimated and the poses' normal matrix is
    /// singular.
    pub fn at(
        scene: &Scene,
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
            problem.tied_freedoms(),
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
            strains: strains(scene, solution),
            posterior,
        })
    }

    /// 1-σ of frame `k`.
    pub fn of_frame(&self, scene: &Scene, k: usize, estimate: &FrameEstimate) -> FrameSigma {
        let w = self.posterior.as_ref().map(|posterior| &posterior.w[k]);
        frame_sigma(
            scene.surface,
            &scene.camera,
            estimate,
            &self.covariances.frames[k],
            w.zip(self.shared.as_ref()),
        )
    }

    /// The doubts with those about frames whose residuals are no noise.
    pub fn with_strain(&self, mut doubts: Vec<Option<Doubt>>) -> Vec<Option<Doubt>> {
        let strained = strained(&self.strains, &doubts);
        for ((doubt, strained), strain) in doubts.iter_mut().zip(strained).zip(&self.strains) {
            if strained {
                *doubt = Some(Doubt::Strained {
                    strain_px: strain.px,
                });
            }
        }
        doubts
    }

    /// The shared unknowns that the data do not observe: all, where too many frames do not fit the
    /// others, or only under strain, or where all are tied too loosely. `scene`: with the
    /// solution's own κ.
    pub fn refused(
        &self,
        scene: &Scene,
        calibration: &Calibration,
        estimates: &[FrameEstimate],
        doubts: &[Option<Doubt>],
    ) -> Vec<Refusal> {
        let Some(posterior) = &self.posterior else {
            return Vec::new();
        };
        let misfits = doubts.iter().flatten().filter(|doubt| doubt.is_misfit());
        let (wrong, count) = (misfits.count(), doubts.len());
        if wrong as f64 > MOST_MISFITS * count as f64 {
            let reason = format!(
                "{wrong} of {count} frames do not fit the others, so the rest may fit in wrong places; give better poses or \
                 a better calibration, or estimate less at once"
            );
            return refuse_all(calibration, &reason);
        }
        let strained = strained(&self.strains, doubts);
        let sure = (0..count).filter(|k| doubts[*k].is_none() && !strained[*k]);
        let sure: Vec<usize> = sure.collect();
        if sure.is_empty() && strained.contains(&true) {
            let reason = "the frames fit each other only under strain: a wall that repeats and is closed a period off, a wrong shape, \
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
        posterior.refuse(calibration)
    }
}

/// Refuses every free unknown.
fn refuse_all(calibration: &Calibration, reason: &str) -> Vec<Refusal> {
    let free = (0..SHARED).filter(|k| calibration.free[*k]);
    free.map(|unknown| Refusal {
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
        let refusals = refuse_all(&calibration, "because");
        assert_eq!(refusals.len(), 1);
        assert_eq!((refusals[0].unknown, refusals[0].sigma), (3, 0.1));
    }
}
