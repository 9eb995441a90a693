//! The covariance of all errors of an estimate: noise, prior, model errors, shared parameters, and
//! what is left of the solve.

use crate::linear::bordered_system::{BorderBlock, SharedBlock};
use crate::linear::normal_equations::Block;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameStep;
use crate::parameters::unseen_errors::{UnseenError, UnseenErrors};
use crate::uncertainty::covariance::{Covariances, NoiseCovariance};
use crate::uncertainty::model_error::{ErrorDraws, EstimateErrors};
use crate::uncertainty::pixel_jacobians::{KappaJacobian, PointJacobians};
use nalgebra::Matrix6;

/// The covariance of the errors of all slots and of the shared parameters.
pub struct TotalCovariance {
    /// By noise.
    pub of_noise: NoiseCovariance,
    /// By model errors and prior; None if the prior leaves a pose free.
    pub errors: Option<EstimateErrors>,
    /// By deformation of the wall that is not seen.
    pub unseen: UnseenErrors,
    /// W of all slots and `Σ_κ`, where the shared parameters were estimated.
    pub shared: Option<(Vec<BorderBlock>, SharedBlock)>,
    /// The undamped step of slots and shared parameters where the solve ended. Whether it would be
    /// right is not known, so it counts as an error.
    pub left: (Vec<FrameStep>, Kappa),
}

impl TotalCovariance {
    /// Covariance of two slots ([`crate::uncertainty::covariance`],
    /// [`crate::uncertainty::model_error`]); None where they have nothing in common.
    pub fn block(&self, j: usize, k: usize) -> Option<Block> {
        // What has nothing in common has no covariance, whatever draws say.
        let inverse = self.of_noise.inverse.block(j, k)?;
        let c = self.of_noise.pixel_dispersion;
        let of_unseen = |error: &UnseenError| match (error.frames.get(j), error.frames.get(k)) {
            (Some(j), Some(k)) => j * k.transpose(),
            _ => Block::zeros(),
        };
        let of_left = self.left.0[j] * self.left.0[k].transpose();
        let beside = of_left + self.unseen.mean(of_unseen);
        let total = match &self.errors {
            // Draws of patches include those of the shared parameters.
            Some(errors) if errors.patches.is_some() => {
                return Some(errors.draws.of_pair(j, k) + beside);
            }
            Some(errors) => inverse * c + errors.draws.of_pair(j, k) * (1.0 - c),
            None => inverse * c,
        } + beside;
        Some(match &self.shared {
            Some((w, covariance)) => total + w[j] * covariance * w[k].transpose(),
            None => total,
        })
    }

    /// Covariances of the first `frames` slots, which are the frames.
    pub fn of_frames(&self, frames: usize) -> Covariances {
        let unknown = Matrix6::from_element(f64::NAN);
        let pose = |j: usize, k: usize| {
            let block = self.block(j, k);
            block.map_or(unknown, |block| block.fixed_view::<6, 6>(0, 0).into_owned())
        };
        Covariances {
            frames: (0..frames).map(|k| pose(k, k)).collect(),
            next: (1..frames).map(|k| pose(k - 1, k)).collect(),
            variance_factor: self.of_noise.variance_factor,
        }
    }

    /// Variance of a point of the wall, the sum along s and h, m²: of `Σ_j J_j x_j + C κ`.
    ///
    /// As slots move by `−W κ` with κ, what κ alone does is `K Σ_κ Kᵀ`, `K = C − Σ_j J_j W_j`.
    pub fn variance(&self, point: &PointJacobians) -> f64 {
        let PointJacobians { slots, shared, .. } = point;
        let of_unseen = |error: &UnseenError| point.moved_by(error).norm_squared();
        let of_left = point
            .moved(|slot| self.left.0[slot], &self.left.1)
            .norm_squared();
        let beside = of_left + self.unseen.mean(of_unseen);
        let c = self.of_noise.pixel_dispersion;
        let of_prior = match &self.errors {
            // Draws of patches include those of the shared parameters.
            Some(errors) if errors.patches.is_some() => {
                return errors.draws.mean_square(point) + beside;
            }
            Some(errors) => (1.0 - c) * errors.draws.mean_square(point),
            None => 0.0,
        };
        let mut of_pixels = 0.0;
        for (n, (j, of_j)) in slots.iter().enumerate() {
            for (m, (k, of_k)) in slots.iter().enumerate().skip(n) {
                if let Some(covariance) = self.of_noise.inverse.block(*j, *k) {
                    let twice = if m == n { 1.0 } else { 2.0 };
                    of_pixels += twice * (of_j * covariance).dot(of_k);
                }
            }
        }
        let of_shared = self.shared.as_ref().map_or(0.0, |(w, covariance)| {
            let moved: KappaJacobian = slots.iter().map(|(slot, of_slot)| of_slot * w[*slot]).sum();
            let left = shared - moved;
            (left * covariance).dot(&left)
        });
        c * of_pixels + of_prior + of_shared + beside
    }

    /// Draws of the errors of the slots from `first` on, by all causes; none if there is no shape,
    /// or if the prior leaves a pose free.
    ///
    /// What is left of the solve is as likely an error one way as the other.
    pub fn error_draws(&self, first: usize) -> Vec<Vec<FrameStep>> {
        let draws = self.errors.as_ref().and_then(EstimateErrors::of_all);
        let left = &self.left.0[first..];
        let draw = |draws: &ErrorDraws, draw: usize| {
            let sign = if draw.is_multiple_of(2) { 1.0 } else { -1.0 };
            let errors = draws.of_slots(first, draw).into_iter().zip(left);
            errors.map(|(error, left)| error + left * sign).collect()
        };
        draws.map_or_else(Vec::new, |draws| {
            (0..draws.count()).map(|k| draw(draws, k)).collect()
        })
    }
}
