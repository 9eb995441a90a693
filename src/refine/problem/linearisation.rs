//! Cost and normal equations of a photometric problem at one estimate.

use crate::refine::linear::bordered_system::SharedBorder;
use crate::refine::linear::normal_equations::{Block, NormalEquations};

/// Cost and normal equations at one estimate.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// Robust cost of pixels plus cost of the prior.
    pub cost: f64,
    /// Normal equations over the active frames.
    pub normal: NormalEquations,
    /// Scatter of the scores, in the pattern's order: `Σ_b g_b g_bᵀ` over the blocks b of the wall,
    /// with g the gradient of the block's cost. It is the variance of the pixels' gradient,
    /// whatever the errors are like.
    pub scatter: Vec<Block>,
    /// How each active frame took part.
    pub frames: Vec<FrameContribution>,
    /// The shared unknowns' part of the equations, if they are estimated.
    pub border: Option<SharedBorder>,
    /// Their part of the scatter.
    pub border_scatter: Option<SharedBorder>,
}

/// How a frame took part in a linearisation.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameContribution {
    /// Wall samples it was compared at.
    pub samples: usize,
    /// `Σ q` over those samples: its pixels that were used.
    pub pixels: f64,
    /// `Σ q ω` over them: what the robust loss left.
    pub inliers: f64,
    /// `Σ q ω e²`, grey levels².
    pub square: f64,
}
