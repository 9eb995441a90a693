//! How sure a solution is, and what of the shared unknowns it does not tell.

use super::calibration::{Calibration, SHARED};
use super::covariance::{Covariances, FrameSigma, Strain, covariances, frame_sigma};
use super::doubt::Doubt;
use super::estimate::FrameEstimate;
use super::gauss_newton::Solution;
use super::grid::BLOCK;
use super::observed::{Posterior, Refusal};
use super::problem::{ProblemError, Scene};
use super::shared::SharedBlock;
use super::tile::SAMPLES;

/// Share of frames that may fit nowhere before nothing is believed about what all frames share: the others may fit each
/// other in wrong places.
const MOST_MISFITS: f64 = 0.1;
/// 1-σ of the median frame on the wall, pixels, beyond which nothing is believed about what all frames share. Frames tied so
/// loosely can tilt and shift together, the camera with them, for less than aliasing does; that is more than the
/// covariance knows of.
const MOST_LOOSE_PX: f64 = 0.2;
/// Largest strain that can be borne of a frame by itself, if it is that many times what noise does ([`Strain`]): a glint on a faint
/// wall makes it a pixel and five to ten times, in one patch of a frame that is right.
const MOST_STRAIN: Strain = Strain {
    times: 12.0,
    px: 0.25,
};
/// Largest strain of the median frame, pixels. Sharp bricks make it 0.01 to 0.03, whatever the noise; a focal length 0.3 % off 0.06, one
/// 1 % off 0.15.
const MOST_USUAL_STRAIN_PX: f64 = 0.08;
/// Wall samples of a patch: of the blocks over which the scatter is told.
const PATCH: i64 = BLOCK * BLOCK * SAMPLES as i64;

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
    /// [`ProblemError::Factor`] if shared unknowns were estimated and the poses' normal matrix is singular.
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

    /// The shared unknowns that the data do not observe: all, where too many frames do not fit the others, or only under strain, or
    /// where all are tied too loosely. `scene`: with the solution's own κ.
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

/// See [`Certainty::strains`].
fn strains(scene: &Scene, solution: &Solution) -> Vec<Strain> {
    let at = &solution.linearisation;
    let pattern = solution.problem.pattern();
    let patch = PATCH as f64 * solution.problem.share_of_wall();
    let of = |(k, estimate): (usize, &FrameEstimate)| {
        let place = pattern.place(k, k)?;
        let blocks = (&at.normal.blocks[place], &at.scatter[place]);
        let patches = at.frames[k].samples as f64 / patch;
        Strain::of_frame(scene.surface, &scene.camera, estimate, blocks, patches)
    };
    let frames = solution.estimates.iter().enumerate();
    frames.map(|frame| of(frame).unwrap_or_default()).collect()
}

/// Which of the frames believed so far are under more strain than can be borne; where their median is, all are.
fn strained(strains: &[Strain], doubts: &[Option<Doubt>]) -> Vec<bool> {
    let believed = (0..doubts.len()).filter(|k| doubts[*k].is_none());
    let mut ordered: Vec<f64> = believed.map(|k| strains[k].px).collect();
    ordered.sort_unstable_by(f64::total_cmp);
    let usual = ordered.get(ordered.len() / 2).copied().unwrap_or(0.0);
    let all = usual > MOST_USUAL_STRAIN_PX;
    let beyond = |strain: &Strain| strain.px > MOST_STRAIN.px && strain.times > MOST_STRAIN.times;
    (0..doubts.len())
        .map(|k| doubts[k].is_none() && (all || beyond(&strains[k])))
        .collect()
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
    use crate::refine::calibration::Kappa;

    #[test]
    fn what_strains_the_median_frame_strains_all() {
        let mut doubts = vec![None; 4];
        doubts[0] = Some(Doubt::Featureless);
        let strain = |times, px| Strain { times, px };
        let of = |strains: [Strain; 4]| strained(&strains, &doubts);
        let (none, usual, much) = (strain(1.5, 0.01), strain(10.0, 0.1), strain(20.0, 0.5));
        let (faint, clean) = (strain(8.0, 1.0), strain(20.0, 0.02));
        assert_eq!(of([much, none, none, none]), [false; 4]);
        assert_eq!(of([none, none, much, usual]), [false, true, true, true]);
        assert_eq!(of([none, none, much, none]), [false, false, true, false]);
        assert_eq!(of([usual, none, usual, none]), [false; 4]);
        assert_eq!(of([none, clean, faint, clean]), [false; 4]);
        assert_eq!(strained(&[], &[]), [false; 0]);
    }

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
