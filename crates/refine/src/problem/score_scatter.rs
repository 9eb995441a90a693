//! Scatter of the scores of the blocks of the wall.

use crate::linear::bordered_system::SharedBorder;
use crate::linear::normal_equations::{Block, Pattern};
use crate::parameters::frame_estimate::FrameStep;
use crate::problem::linearisation::{BlockGradient, Linearisation};
use crate::problem::photometric_problem::PhotometricProblem;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Scatter of the scores: `Σ_b g_b g_bᵀ` over the blocks b of the wall, with `g_b` the gradient of
/// the block's cost.
///
/// It estimates the variance of the pixels' gradient for any distribution of the errors.
#[derive(Clone, Debug)]
pub struct ScoreScatter {
    /// Blocks of slots, in the pattern's order.
    pub blocks: Vec<Block>,
    /// The border, if the shared parameters are estimated.
    pub border: Option<SharedBorder>,
    /// Scores of slots with this scatter: their sum with random signs.
    pub signed: Vec<FrameStep>,
}

impl ScoreScatter {
    /// Adds the outer product of a gradient.
    fn add(&mut self, pattern: &Pattern, block: &BlockGradient) {
        let gradients = &block.slot_gradients;
        for (column, slot) in block.slots.iter().enumerate() {
            for row in 0..=column {
                if let Some(index) = pattern.block_index(block.slots[row], *slot) {
                    self.blocks[index] += gradients[row] * gradients[column].transpose();
                }
            }
        }
        if let Some((border, shared)) = self.border.as_mut().zip(block.shared.as_ref()) {
            let slots = block.slots.iter().copied();
            border.add_scatter(slots.zip(gradients.iter().copied()), shared);
        }
    }
}

impl PhotometricProblem<'_> {
    /// The scatter of the scores `at` an estimate, scaled as the gradient of the cost is.
    pub fn score_scatter(&self, at: &Linearisation) -> ScoreScatter {
        let pattern = self.pattern();
        let mut scatter = ScoreScatter {
            blocks: vec![Block::zeros(); pattern.blocks()],
            border: self
                .estimates_shared
                .then(|| SharedBorder::zeros(pattern.columns())),
            signed: self.signed_scores(at),
        };
        for block in &at.block_gradients {
            scatter.add(pattern, block);
        }
        let square = self.information().powi(2);
        scatter.blocks.iter_mut().for_each(|block| *block *= square);
        if let Some(border) = &mut scatter.border {
            border.scale(square);
        }
        scatter
    }

    /// Scores of slots with this scatter, `at` an estimate: their sum with random signs.
    pub fn signed_scores(&self, at: &Linearisation) -> Vec<FrameStep> {
        let mut scores = vec![FrameStep::zeros(); self.pattern().columns()];
        let mut random = ChaCha8Rng::seed_from_u64(0);
        for block in &at.block_gradients {
            let sign = if random.random() { 1.0 } else { -1.0 };
            let scale = sign * self.information();
            for (slot, gradient) in block.slots.iter().zip(&block.slot_gradients) {
                scores[*slot] += gradient * scale;
            }
        }
        scores
    }
}
