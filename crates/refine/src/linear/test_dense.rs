//! Equations of tests, sparse and as dense matrices to compare with.

use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use nalgebra::DMatrix;

/// Writes the block of two frames and its transpose into a symmetric matrix.
pub fn set_block(dense: &mut DMatrix<f64>, row: usize, column: usize, block: &Block) {
    let at = |k: usize| k * FRAME_PARAMETERS;
    let size = (FRAME_PARAMETERS, FRAME_PARAMETERS);
    dense.view_mut((at(row), at(column)), size).copy_from(block);
    dense
        .view_mut((at(column), at(row)), size)
        .tr_copy_from(block);
}

/// Random equations of frames that overlap with the next one and the fourth, as on a spiral, and
/// their matrix, which `diagonal` makes positive definite.
pub fn random_equations(
    frames: usize,
    seed: u32,
    diagonal: f64,
) -> (Pattern, NormalEquations, DMatrix<f64>) {
    let last = frames - 1;
    let pairs = (0..frames).flat_map(|k| [(k, (k + 1).min(last)), (k, (k + 4).min(last))]);
    let pattern = Pattern::new(frames, pairs);
    let mut normal = NormalEquations::zeros(&pattern);
    let n = frames * FRAME_PARAMETERS;
    let mut dense = DMatrix::zeros(n, n);
    let mut seed = seed;
    let mut random = || {
        seed = seed.wrapping_mul(1664525).wrapping_add(1013904223);
        f64::from(seed >> 8) / f64::from(1 << 24) - 0.5
    };
    for column in 0..frames {
        for &row in pattern.rows(column) {
            let mut block = Block::from_fn(|_, _| random());
            if row == column {
                block = block * block.transpose() + Block::identity() * diagonal;
            }
            normal.add_block(&pattern, row, column, &block);
            set_block(&mut dense, row, column, &block);
        }
        normal.gradient[column] = FrameStep::from_fn(|_, _| random());
    }
    (pattern, normal, dense)
}
