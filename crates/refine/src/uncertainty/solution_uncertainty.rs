//! Uncertainty of a solution: of its poses, and of the shared parameters that it does not observe.

use crate::linear::bordered_system::SharedBlock;
use crate::linear::factor_error::FactorError;
use crate::linear::normal_equations::Pattern;
use crate::linear::sparse_cholesky::Factor;
use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::parameters::calibration::{Calibration, Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::{FrameEstimate, FrameStep};
use crate::parameters::unseen_errors::{UnseenError, UnseenErrors};
use crate::problem::linearisation::FrameContribution;
use crate::solver::gauss_newton::Solution;
use crate::thresholds::observability::MAX_MISFIT_SHARE;
use crate::uncertainty::covariance::{Covariances, compute_covariances};
use crate::uncertainty::frame_sigma::{FrameSigma, compute_frame_sigma_by};
use crate::uncertainty::model_error::{EstimateErrors, ModelErrorReport};
use crate::uncertainty::observability::{Posterior, UnobservableParameter};
use crate::uncertainty::overdispersion::{Overdispersion, compute_overdispersions};
use crate::uncertainty::pixel_jacobians::{PointJacobians, pixel_jacobians};
use crate::uncertainty::registration_sigma::registration_sigmas;
use crate::uncertainty::total_covariance::TotalCovariance;
use tunnelstitch_geometry::surface::{Hit, WallFrame};

/// The uncertainty of a solution.
pub struct SolutionUncertainty {
    /// Covariances of the poses.
    pub covariances: Covariances,
    /// 1-σ of every frame against the wall that the others show, pixels.
    pub registration_px: Vec<f64>,
    /// Errors beyond noise, if the residuals show any.
    pub model_error: Option<ModelErrorReport>,
    /// Covariance `Σ_κ` of the shared parameters, where they were estimated, with the square of the
    /// step that was left of the solve.
    pub shared: Option<SharedBlock>,
    /// Overdispersion of every frame; 0 for those that show nothing.
    pub overdispersions: Vec<Overdispersion>,
    /// Covariance of all unknowns; None where the equations are singular.
    pub total: Option<TotalCovariance>,
    posterior: Option<Posterior>,
}

impl SolutionUncertainty {
    /// Computes the uncertainty of a solution, of which the gradients of the blocks of the wall are
    /// taken, with the free parameters of `calibration`;
    /// `context`: with the solution's own κ and shape; `unseen`: errors by what is
    /// not seen of the wall's shape; `alpha`: rate of false alarms.
    ///
    /// # Errors
    /// [`ProblemError::Factor`] if shared parameters were estimated and the poses' normal matrix is
    /// singular.
    pub fn at(
        context: &EstimationContext,
        solution: &mut Solution,
        calibration: &Calibration,
        unseen: &UnseenErrors,
        alpha: f64,
    ) -> Result<Self, ProblemError> {
        let scatter = solution.problem.score_scatter(&solution.linearisation);
        let finest = solution.take_patch_scores()?;
        let frames = solution.unknowns.frames.len();
        let at_end = (&solution.linearisation, &solution.linearised_at);
        let (problem, unknowns) = (&solution.problem, &solution.unknowns);
        let (observed, posterior, factor) =
            Posterior::with_curvature(problem, at_end, unknowns, &scatter)?;
        // Pixels are no longer needed.
        solution.problem.coverage.release();
        context.frames.release();
        let solution = &*solution;
        let problem = &solution.problem;
        let curvature = observed.effective();
        let of_free = |posterior: &Posterior| posterior.covariance(&calibration.free);
        let mut shared = posterior.as_ref().and_then(of_free);
        let overdispersions = compute_overdispersions(context, solution, &scatter);
        let of_noise = factor.as_ref().and_then(|factor| {
            let covariances = compute_covariances(
                problem.pattern(),
                frames,
                (&solution.linearisation.normal, factor),
                problem.constrained_gauge_freedoms(),
                scatter.blocks,
                || problem.other_information(&solution.unknowns),
                curvature,
            );
            covariances.ok()
        });
        // Poses without a covariance still count; they are reported as uncertain.
        let total = match factor.zip(of_noise) {
            Some((factor, of_noise)) => {
                let at_end = (&factor, curvature);
                let posterior = posterior.as_ref();
                let errors =
                    EstimateErrors::find(solution, at_end, posterior, (&of_noise, &finest), alpha)?;
                if let (Some(shared), Some(errors)) = (&mut shared, &errors) {
                    *shared += errors.draws.of_shared();
                }
                let left = step_left(solution, &factor, curvature)?;
                // The draws of what is not seen, and the step left, have what the shared parameters
                // do to frames.
                let of_shared = posterior.zip(shared);
                if let Some(shared) = &mut shared {
                    let square = |draw: &UnseenError| draw.shared * draw.shared.transpose();
                    *shared += unseen.mean(square) + left.1 * left.1.transpose();
                }
                Some(TotalCovariance {
                    of_noise,
                    errors,
                    unseen: unseen.clone(),
                    left,
                    shared: of_shared.map(|(posterior, shared)| (posterior.w.clone(), shared)),
                })
            }
            None => None,
        };
        let errors = total.as_ref().and_then(|total| total.errors.as_ref());
        let patches = errors.and_then(|errors| errors.patches);
        Ok(Self {
            covariances: match &total {
                Some(total) => total.of_frames(frames),
                None => Covariances::unknown(frames),
            },
            registration_px: match &total {
                Some(total) => {
                    let estimates = &solution.unknowns.frames;
                    let neighbours = neighbours(problem.pattern(), &solution.linearisation.frames);
                    registration_sigmas(context, estimates, &neighbours, total)
                }
                None => vec![f64::NAN; frames],
            },
            model_error: patches.map(|found| ModelErrorReport::new(&found, problem)),
            shared,
            overdispersions,
            total,
            posterior,
        })
    }

    /// Dispersion of the scores of pixels: of those of patches, or of blocks if all is noise; 1
    /// where the equations are singular.
    pub fn dispersion(&self) -> f64 {
        let of_noise = |total: &TotalCovariance| total.of_noise.pixel_dispersion;
        match &self.model_error {
            Some(found) => found.dispersion,
            None => self.total.as_ref().map_or(1.0, of_noise),
        }
    }

    /// Computes 1-σ of frame `k` at its estimate.
    pub fn frame_sigma(
        &self,
        context: &EstimationContext,
        k: usize,
        estimate: &FrameEstimate,
    ) -> FrameSigma {
        let frames = self.covariances.frames.len();
        let wall_variance = |hit: &Hit, frame: &WallFrame| {
            let total = self.total.as_ref()?;
            let pixel = pixel_jacobians(context, (k, &estimate.pose), hit.wall, frame);
            let mut point = PointJacobians::default();
            point.add_pixel(k, &pixel, 1.0);
            let model = context.shape.as_ref().map(|shape| &shape.model);
            point.add_wall(pixel.tau, hit.wall, model, frames);
            Some(total.variance(&point))
        };
        FrameSigma {
            registration_px: self.registration_px[k],
            ..compute_frame_sigma_by(
                context.surface.as_ref(),
                context.cameras.of(k),
                estimate,
                &self.covariances.frames[k],
                wall_variance,
            )
        }
    }

    /// Finds the shared parameters that the data do not observe. All are unobservable if too many
    /// frames do not fit the others.
    pub fn find_unobservable(
        &self,
        calibration: &Calibration,
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
        posterior.find_unobservable(calibration)
    }
}

/// The undamped step of all slots and of the shared parameters where the solve ended, with the
/// curvature there; `factor`: of the normal matrix.
fn step_left(
    solution: &Solution,
    factor: &Factor,
    curvature: f64,
) -> Result<(Vec<FrameStep>, Kappa), ProblemError> {
    let problem = &solution.problem;
    let step = (solution.linearisation).step(factor, 0.0, problem.tested());
    let (mut slots, shared) =
        step.ok_or_else(|| problem.factor_error(FactorError::NotPositiveDefinite))?;
    slots.iter_mut().for_each(|slot| *slot /= curvature);
    Ok((slots, shared / curvature))
}

/// Of every frame, those that are compared and may see part of the same wall.
fn neighbours(pattern: &Pattern, frames: &[FrameContribution]) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); frames.len()];
    let is_compared = |k: &usize| frames[*k].samples > 0;
    for column in (0..frames.len()).filter(is_compared) {
        let rows = pattern.rows(column).iter().filter(|row| is_compared(row));
        for &row in rows.filter(|row| **row != column) {
            neighbours[row].push(column);
            neighbours[column].push(row);
        }
    }
    neighbours
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
        let mut calibration = Calibration::none(Camera::from_vertical_fov(160, 120, 1.0));
        calibration.sigma = Kappa::repeat(0.1);
        calibration.free[3] = true;
        let unobservable = mark_all_unobservable(&calibration, "because");
        assert_eq!(unobservable.len(), 1);
        assert_eq!((unobservable[0].unknown, unobservable[0].sigma), (3, 0.1));
    }
}
