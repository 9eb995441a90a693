//! Cost and normal equations of a photometric problem at one estimate.

use crate::linear::bordered_system::SharedBorder;
use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
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
    /// Contribution of each active frame.
    pub frames: Vec<FrameContribution>,
    /// Border of the equations, if the shared parameters are estimated.
    pub border: Option<SharedBorder>,
    /// Gradients of the pixels' cost in every block of the wall, in units of grey levels².
    pub block_gradients: Vec<BlockGradient>,
    /// Part of a diagonal block of the normal matrix that constrains the gauge, and its index.
    pub constraint: Option<(usize, Block)>,
}

/// Information that is not that of pixels: of the prior, and of measured points. It has a small
/// part of the blocks of the normal matrix.
pub struct OtherInformation {
    /// The pattern of its blocks.
    pub pattern: Pattern,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// The border.
    pub border: SharedBorder,
}

/// Gradient of the pixels' cost in one block of the wall.
#[derive(Clone, Debug)]
pub struct BlockGradient {
    /// Row and column of the block.
    pub block: (i64, i64),
    /// Its slots, ascending.
    pub slots: Vec<usize>,
    /// Gradient, slot by slot.
    pub slot_gradients: Vec<FrameStep>,
    /// Gradient of the shared parameters, if they are estimated.
    pub shared: Option<Kappa>,
}

impl BlockGradient {
    /// Adds `factor` times the gradient of a part of the block, all of whose slots are slots of it.
    pub fn add(&mut self, part: &Self, factor: f64) {
        for (slot, gradient) in part.slots.iter().zip(&part.slot_gradients) {
            if let Ok(index) = self.slots.binary_search(slot) {
                self.slot_gradients[index] += gradient * factor;
            }
        }
        if let (Some(shared), Some(part)) = (&mut self.shared, &part.shared) {
            *shared += part * factor;
        }
    }
}

impl Linearisation {
    /// Changes the sign of the cost, the equations and the frames' contributions, but for the
    /// numbers of samples.
    pub fn negate(&mut self) {
        self.cost = -self.cost;
        self.normal
            .blocks
            .iter_mut()
            .for_each(|block| *block = -*block);
        self.normal
            .gradient
            .iter_mut()
            .for_each(|gradient| *gradient = -*gradient);
        for frame in &mut self.frames {
            frame.pixels = -frame.pixels;
            frame.inliers = -frame.inliers;
            frame.square = -frame.square;
        }
        if let Some(border) = &mut self.border {
            border.scale(-1.0);
        }
    }

    /// The change of the cost and of its gradient by the quadratic model along a step of all slots
    /// and of the shared parameters: `gᵀδ + ½ δᵀHδ` and `H δ`.
    pub fn predict(
        &self,
        pattern: &Pattern,
        (step, shared): (&[FrameStep], &Kappa),
    ) -> (f64, Vec<FrameStep>, Kappa) {
        let mut product = pattern.product(&self.normal.blocks, step);
        let mut shared_product = Kappa::zeros();
        if let Some(border) = &self.border {
            for ((block, product), step) in border.frames.iter().zip(&mut product).zip(step) {
                *product += block * shared;
                shared_product += block.tr_mul(step);
            }
            shared_product += border.own * shared;
        }
        let products = product.iter().zip(step);
        let square: f64 = products.map(|(p, s)| p.dot(s)).sum::<f64>() + shared_product.dot(shared);
        let slope = self.slope(step, shared);
        (slope + 0.5 * square, product, shared_product)
    }

    /// The derivative of the cost along a step of all slots and of the shared parameters: `gᵀδ`.
    pub fn slope(&self, step: &[FrameStep], shared: &Kappa) -> f64 {
        let gradient = &self.normal.gradient;
        let of_slots: f64 = gradient.iter().zip(step).map(|(g, step)| g.dot(step)).sum();
        let border = self.border.as_ref();
        of_slots + border.map_or(0.0, |border| border.gradient.dot(shared))
    }

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
