//! Cost and normal equations of a photometric problem at one estimate.

use crate::linear::bordered_system::SharedBorder;
use crate::linear::normal_equations::{Block, NormalEquations};
use crate::linear::sparse_cholesky::Factor;
use crate::parameters::calibration::{Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::FrameStep;

/// Cost and normal equations at one estimate ([`crate::tiles::tile`]).
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// Robust cost of the pixels plus cost of the prior.
    pub cost: f64,
    /// Normal equations over the active frames.
    pub normal: NormalEquations,
    /// Scatter of the scores, in the pattern's order: `Σ_b g_b g_bᵀ` over the blocks b of the wall,
    /// with `g_b` the gradient of the block's cost.
    ///
    /// It estimates the variance of the pixels' gradient for any distribution of the errors.
    pub scatter: Vec<Block>,
    /// Contribution of each active frame.
    pub frames: Vec<FrameContribution>,
    /// Border of the equations, if the shared parameters are estimated.
    pub border: Option<SharedBorder>,
    /// Border of the scatter.
    pub border_scatter: Option<SharedBorder>,
}

impl Linearisation {
    /// The step of all slots and of the shared parameters by a factor of the normal matrix that is
    /// damped by λ, with the shared parameters `held` fixed; None if the border is not positive
    /// definite.
    pub fn step(
        &self,
        factor: &Factor,
        lambda: f64,
        held: &[bool; SHARED_PARAMETERS],
    ) -> Option<(Vec<FrameStep>, Kappa)> {
        let gradient = &self.normal.gradient;
        match &self.border {
            Some(border) => border.step(factor, gradient, (lambda, held)),
            None => Some((factor.step(gradient), Kappa::zeros())),
        }
    }
}

/// Contribution of a frame to a linearisation.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameContribution {
    /// Number of wall samples at which it was compared.
    pub samples: usize,
    /// `Σ q` over these samples: the number of its pixels.
    pub pixels: f64,
    /// `Σ q ω` over these samples: the pixels by robust weight.
    pub inliers: f64,
    /// `Σ q ω e²` over these samples, grey levels².
    pub square: f64,
}
