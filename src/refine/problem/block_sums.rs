//! What a block of the wall adds to the normal equations.

use crate::refine::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::refine::parameters::frame_estimate::FrameStep;
use crate::refine::problem::intrinsics_terms::IntrinsicsSums;
use crate::refine::problem::linearisation::FrameContribution;
use crate::refine::problem::observer_column::Column;
use crate::refine::tiles::tile::SAMPLES;
use nalgebra::Matrix4;

/// What a tile adds to the normal equations.
pub struct TileSums {
    pub columns: Vec<Column>,
    /// M.
    pub features: Matrix4<f64>,
    /// Weight of all observers, held ones too.
    pub total: f64,
}

/// Sums over the tiles of one block, for the few active frames that see it.
pub struct BlockSums {
    /// The frames, counted among the active ones.
    pub slots: Vec<usize>,
    /// Robust cost.
    pub cost: f64,
    /// Gradient, a frame after another.
    pub gradient: Vec<FrameStep>,
    shares: Vec<FrameContribution>,
    /// Upper triangle, row by row.
    blocks: Vec<Block>,
    /// The lens's part, if it is estimated.
    pub lens: Option<IntrinsicsSums>,
}

impl BlockSums {
    pub fn new(slots: Vec<usize>, calibrates: bool) -> Self {
        let n = slots.len();
        Self {
            slots,
            cost: 0.0,
            gradient: vec![FrameStep::zeros(); n],
            shares: vec![FrameContribution::default(); n],
            blocks: vec![Block::zeros(); n * (n + 1) / 2],
            lens: calibrates.then(|| IntrinsicsSums::new(n)),
        }
    }

    /// Place of a slot among this block's; it must be one of them.
    pub fn place(&self, slot: usize) -> usize {
        self.slots.partition_point(|s| *s < slot)
    }

    #[inline(always)]
    fn block_index(&self, row: usize, column: usize) -> usize {
        let n = self.slots.len();
        row * n - row * (row + 1) / 2 + column
    }

    /// `features`: M of the tile; `total`: weight of all its observers, held ones too.
    #[inline(always)]
    pub fn add_tile(&mut self, columns: &[Column], features: &Matrix4<f64>, total: f64) {
        for (n, b) in columns.iter().enumerate() {
            let moments = &b.moments;
            let share = &mut self.shares[b.place];
            share.samples += SAMPLES;
            share.pixels += moments.pixels;
            share.inliers += moments.inliers;
            share.square += moments.square;
            let gradient = &mut self.gradient[b.place];
            for k in 0..6 {
                gradient[k] -=
                    b.a[(0, k)] * moments.gradient[0] + b.a[(1, k)] * moments.gradient[1];
            }
            gradient[6] -= moments.gradient[2];
            gradient[7] -= moments.gradient[3] * b.inverse_gain;
            let f = b.features_times_b(features);
            for a in &columns[..=n] {
                let own = if a.place == b.place {
                    a.moments.weight
                } else {
                    0.0
                };
                let scale = own - a.moments.weight * moments.weight / total.max(1e-12);
                let index = self.block_index(a.place, b.place);
                a.add_b_transposed_times(&f, scale, &mut self.blocks[index]);
            }
        }
    }

    /// Adds the block to the normal equations, their scatter and the frames' shares.
    pub fn add_to(
        &self,
        pattern: &Pattern,
        normal: &mut NormalEquations,
        scatter: &mut [Block],
        frames: &mut [FrameContribution],
    ) {
        for (column, slot) in self.slots.iter().enumerate() {
            normal.gradient[*slot] += self.gradient[column];
            let (share, sum) = (&mut frames[*slot], &self.shares[column]);
            share.samples += sum.samples;
            share.pixels += sum.pixels;
            share.inliers += sum.inliers;
            share.square += sum.square;
            for row in 0..=column {
                let block = &self.blocks[self.block_index(row, column)];
                normal.add_block(pattern, self.slots[row], *slot, block);
                if let Some(place) = pattern.block_index(self.slots[row], *slot) {
                    scatter[place] += self.gradient[row] * self.gradient[column].transpose();
                }
            }
        }
    }
}
