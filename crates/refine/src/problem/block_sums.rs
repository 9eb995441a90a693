//! Contribution of a block of the wall to the normal equations.

use crate::linear::normal_equations::{Block, Pattern};
use crate::parameters::frame_estimate::FrameStep;
use crate::problem::intrinsics_terms::IntrinsicsSums;
use crate::problem::linearisation::{BlockGradient, FrameContribution, Linearisation};
use crate::problem::observer_column::ObserverColumn;
use crate::tiles::tile_arrays::SAMPLES;
use nalgebra::Matrix4;

/// Contribution of a tile to the normal equations.
pub struct TileSums {
    /// Columns of its active observers.
    pub columns: Vec<ObserverColumn>,
    /// M.
    pub features: Matrix4<f64>,
    /// Sum of the mean weights `w̄` of all observers, held ones too.
    pub total_weight: f64,
}

/// Sums over the tiles of one block, for the few active frames that observe it and the functions of
/// the wall's shape there.
pub struct BlockSums {
    /// Slots of the frames and, behind them, of the blocks of the shape, ascending.
    pub slots: Vec<usize>,
    /// Robust cost.
    pub cost: f64,
    /// Gradient, slot by slot.
    pub gradient: Vec<FrameStep>,
    /// Contribution of each frame.
    contributions: Vec<FrameContribution>,
    /// Upper triangle of the normal matrix, row by row.
    blocks: Vec<Block>,
    /// Part of the intrinsics and the readout time, if they are estimated.
    pub intrinsics: Option<IntrinsicsSums>,
}

impl BlockSums {
    /// Zero sums of the ascending `slots`, of which the first `frames` are frames, with the border
    /// if the shared parameters are estimated.
    pub fn new(slots: Vec<usize>, frames: usize, estimates_shared: bool) -> Self {
        let n = slots.len();
        Self {
            slots,
            cost: 0.0,
            gradient: vec![FrameStep::zeros(); n],
            contributions: vec![FrameContribution::default(); frames],
            blocks: vec![Block::zeros(); n * (n + 1) / 2],
            intrinsics: estimates_shared.then(|| IntrinsicsSums::new(n)),
        }
    }

    /// Index of a slot among those of this block; it must be one of them.
    pub fn index_of(&self, slot: usize) -> usize {
        self.slots.partition_point(|s| *s < slot)
    }

    /// Index of a block of the upper triangle.
    #[inline(always)]
    fn block_index(&self, row: usize, column: usize) -> usize {
        let n = self.slots.len();
        row * n - row * (row + 1) / 2 + column
    }

    /// Block (row, column) of the upper triangle.
    #[inline(always)]
    pub fn block_mut(&mut self, row: usize, column: usize) -> &mut Block {
        let index = self.block_index(row, column);
        &mut self.blocks[index]
    }

    /// Adds a tile: `g = −B_iᵀ g_i`, `H_ij = (w̄_i δ_ij − w̄_i w̄_j / Σw̄) B_iᵀ M B_j`.
    ///
    /// `features`: M; `total_weight`: `Σw̄` over all its observers, held ones too.
    #[inline(always)]
    pub fn add_tile(
        &mut self,
        columns: &[ObserverColumn],
        features: &Matrix4<f64>,
        total_weight: f64,
    ) {
        for (n, b) in columns.iter().enumerate() {
            let moments = &b.moments;
            let contribution = &mut self.contributions[b.frame];
            contribution.samples += SAMPLES;
            contribution.pixels += moments.pixels;
            contribution.inliers += moments.inliers;
            contribution.square += moments.square;
            let gradient = &mut self.gradient[b.frame];
            for k in 0..6 {
                gradient[k] -=
                    b.a[(0, k)] * moments.gradient[0] + b.a[(1, k)] * moments.gradient[1];
            }
            gradient[6] -= moments.gradient[2];
            gradient[7] -= moments.gradient[3] * b.inverse_gain;
            let f = b.features_times_b(features);
            for a in &columns[..=n] {
                let own = if a.frame == b.frame {
                    a.moments.weight
                } else {
                    0.0
                };
                let scale = own - a.moments.weight * moments.weight / total_weight.max(1e-12);
                let index = self.block_index(a.frame, b.frame);
                a.add_b_transposed_times(&f, scale, &mut self.blocks[index]);
            }
        }
    }

    /// The gradient; the block has the given row and column.
    pub fn block_gradient(&self, block: (i64, i64)) -> BlockGradient {
        let intrinsics = self.intrinsics.as_ref();
        BlockGradient {
            block,
            slots: self.slots.clone(),
            slot_gradients: self.gradient.clone(),
            shared: intrinsics.map(IntrinsicsSums::shared_gradient),
        }
    }

    /// Product of the block's normal matrix and a step of all slots, slot by slot of the block.
    pub fn product(&self, step: &[FrameStep]) -> Vec<FrameStep> {
        let mut product = vec![FrameStep::zeros(); self.slots.len()];
        for (column, slot) in self.slots.iter().enumerate() {
            for row in 0..=column {
                let block = &self.blocks[self.block_index(row, column)];
                product[row] += block * step[*slot];
                if row != column {
                    product[column] += block.tr_mul(&step[self.slots[row]]);
                }
            }
        }
        product
    }

    /// Adds the block to the cost, the normal equations with their border, and the frames'
    /// contributions.
    pub fn add_to(&self, pattern: &Pattern, sums: &mut Linearisation) {
        self.add_equations(pattern, 1.0, sums);
        self.add_contributions(1.0, sums);
        for (slot, sum) in self.slots.iter().zip(&self.contributions) {
            sums.frames[*slot].samples += sum.samples;
        }
    }

    /// Adds `factor` times the block to the frames' contributions, but for the numbers of samples.
    pub fn add_contributions(&self, factor: f64, sums: &mut Linearisation) {
        for (slot, sum) in self.slots.iter().zip(&self.contributions) {
            let frame = &mut sums.frames[*slot];
            frame.pixels += sum.pixels * factor;
            frame.inliers += sum.inliers * factor;
            frame.square += sum.square * factor;
        }
    }

    /// Adds `factor` times the block to the cost and the normal equations with their border.
    pub fn add_equations(&self, pattern: &Pattern, factor: f64, sums: &mut Linearisation) {
        sums.cost += self.cost * factor;
        for (column, slot) in self.slots.iter().enumerate() {
            sums.normal.gradient[*slot] += self.gradient[column] * factor;
            for row in 0..=column {
                let block = self.blocks[self.block_index(row, column)] * factor;
                sums.normal
                    .add_block(pattern, self.slots[row], *slot, &block);
            }
        }
        if let Some((intrinsics, border)) = self.intrinsics.as_ref().zip(sums.border.as_mut()) {
            intrinsics.add_to(&self.slots, factor, border);
        }
    }
}
