//! Dense matrices that tests compare the sparse ones with.

use crate::linear::normal_equations::Block;
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
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
