//! The covariance of all errors of an estimate: noise, prior, model errors, shared parameters.

use crate::linear::bordered_system::{BorderBlock, SharedBlock};
use crate::linear::normal_equations::Block;
use crate::parameters::calibration::SHARED_PARAMETERS;
use crate::parameters::shape::{FunctionValue, ShapeStep};
use crate::uncertainty::covariance::{Covariances, NoiseCovariance};
use crate::uncertainty::model_error::EstimateErrors;
use nalgebra::{Matrix2x6, Matrix6, SMatrix, SVector, Vector2};
use std::collections::BTreeMap;

/// The covariance of the errors of all slots and of the shared parameters.
pub struct TotalCovariance {
    /// By noise.
    pub of_noise: NoiseCovariance,
    /// By model errors and prior; None if the prior leaves a pose free.
    pub errors: Option<EstimateErrors>,
    /// W of all slots and `Σ_κ`, where the shared parameters were estimated.
    pub shared: Option<(Vec<BorderBlock>, SharedBlock)>,
}

/// Jacobians of the wall point of a fixed pixel.
pub struct PixelJacobians<'j> {
    /// `A = ∂(s, h)/∂ξ`.
    pub pose: Matrix2x6<f64>,
    /// `C = ∂(s, h)/∂κ`.
    pub shared: SMatrix<f64, 2, SHARED_PARAMETERS>,
    /// `τ = ∂(s, h)/∂δ`, with the shape's functions there and the slot of their first block.
    pub shape: Option<(Vector2<f64>, &'j [FunctionValue], usize)>,
}

impl TotalCovariance {
    /// Covariance of two slots ([`crate::uncertainty::covariance`],
    /// [`crate::uncertainty::model_error`]); None where they have nothing in common.
    pub fn block(&self, j: usize, k: usize) -> Option<Block> {
        // What has nothing in common has no covariance, whatever draws say.
        let inverse = self.of_noise.inverse.block(j, k)?;
        let c = self.of_noise.pixel_dispersion;
        let total = match &self.errors {
            // Draws of patches include those of the shared parameters.
            Some(errors) if errors.patches.is_some() => return Some(errors.draws.of_pair(j, k)),
            Some(errors) => inverse * c + errors.draws.of_pair(j, k) * (1.0 - c),
            None => inverse * c,
        };
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

    /// Variance of the wall point of a fixed pixel of frame `k`, the sum along s and h, m²: of
    /// `A ξ + C κ + τ δ`.
    ///
    /// As slots move by `−W κ` with κ, their covariance with it is `−W Σ_κ`.
    pub fn wall_variance(&self, k: usize, pixel: &PixelJacobians) -> f64 {
        let Some(pose) = self.block(k, k) else {
            return f64::NAN;
        };
        let a = &pixel.pose;
        let mut variance = (a * pose.fixed_view::<6, 6>(0, 0) * a.transpose()).trace();
        // By the slots: A ξ, and τ φᵀ c for a block of the shape.
        let mut crossed_w = SVector::<f64, 2>::zeros();
        let shared = self.shared.as_ref();
        let shared = shared.map(|(w, covariance)| (w, pixel.shared * covariance));
        if let Some((w, shared)) = &shared {
            let own = shared * pixel.shared.transpose();
            let crossed = shared * w[k].fixed_rows::<6>(0).transpose() * a.transpose();
            variance += own.trace() - 2.0 * crossed.trace();
        }
        let Some((tau, functions, first)) = pixel.shape else {
            return variance;
        };
        let blocks = by_slot(functions, first);
        variance += tau.norm_squared() * self.variance_of(&blocks);
        for (slot, phi) in &blocks {
            if let Some(covariance) = self.block(k, *slot) {
                let with_pose = a * covariance.fixed_rows::<6>(0) * phi;
                variance += 2.0 * with_pose.dot(&tau);
            }
            if let Some((w, shared)) = &shared {
                crossed_w += shared * (w[*slot].transpose() * phi);
            }
        }
        variance - 2.0 * crossed_w.dot(&tau)
    }

    /// Variance of the wall's displacement where the shape has the given `functions`, m²; `first`:
    /// slot of its first block.
    pub fn shape_variance(&self, functions: &[FunctionValue], first: usize) -> f64 {
        self.variance_of(&by_slot(functions, first))
    }

    /// Variance of `Σ φᵀ c` over blocks of the shape, by their slots.
    fn variance_of(&self, blocks: &BTreeMap<usize, ShapeStep>) -> f64 {
        let mut variance = 0.0;
        for (n, (slot, phi)) in blocks.iter().enumerate() {
            for (m, (other, phi_other)) in blocks.iter().enumerate().skip(n) {
                if let Some(covariance) = self.block(*slot, *other) {
                    let twice = if m == n { 1.0 } else { 2.0 };
                    variance += twice * (phi.transpose() * covariance * phi_other)[0];
                }
            }
        }
        variance
    }
}

/// Functions of a shape by the slot of their block, ascending.
fn by_slot(functions: &[FunctionValue], first: usize) -> BTreeMap<usize, ShapeStep> {
    let mut blocks: BTreeMap<usize, ShapeStep> = BTreeMap::new();
    for function in functions {
        let block = blocks.entry(first + function.block).or_default();
        block[function.component] = function.value;
    }
    blocks
}
