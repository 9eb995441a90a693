//! The normal equations: a symmetric block-sparse matrix and a gradient.
//!
//! Every slot stands for eight parameters: those of a frame, or, behind all frames, a block of
//! coefficients of the wall's shape ([`crate::parameters::shape`]).

use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use nalgebra::SMatrix;

/// One block of the normal matrix: the parameters of one slot by those of another.
pub type Block = SMatrix<f64, FRAME_PARAMETERS, FRAME_PARAMETERS>;

/// Sparsity pattern of the upper triangle: for every block column the ascending rows up to the
/// diagonal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    rows: Vec<Vec<usize>>,
    starts: Vec<usize>,
}

impl Pattern {
    /// The pattern of `slots` blocks of parameters of which the `pairs` (any order, repeated or
    /// not) share residuals; the diagonal always exists.
    pub fn new(slots: usize, pairs: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let mut rows: Vec<Vec<usize>> = (0..slots).map(|k| vec![k]).collect();
        for (a, b) in pairs {
            rows[a.max(b)].push(a.min(b));
        }
        let mut starts = Vec::with_capacity(slots);
        let mut total = 0;
        for column in &mut rows {
            column.sort_unstable();
            column.dedup();
            starts.push(total);
            total += column.len();
        }
        Self { rows, starts }
    }

    /// Number of block columns.
    pub fn columns(&self) -> usize {
        self.rows.len()
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.rows.iter().map(Vec::len).sum()
    }

    /// Ascending block rows of a block column, the diagonal last.
    pub fn rows(&self, column: usize) -> &[usize] {
        &self.rows[column]
    }

    /// Index of block (row, column) among all blocks, if it exists; `row ≤ column`.
    pub fn block_index(&self, row: usize, column: usize) -> Option<usize> {
        let found = self.rows[column].binary_search(&row).ok()?;
        Some(self.starts[column] + found)
    }
}

impl Pattern {
    /// Product of a symmetric matrix, with these upper `blocks`, and a vector.
    pub fn product(&self, blocks: &[Block], vector: &[FrameStep]) -> Vec<FrameStep> {
        let mut product = vec![FrameStep::zeros(); vector.len()];
        for column in 0..self.columns() {
            for (&row, block) in self.rows(column).iter().zip(&blocks[self.starts[column]..]) {
                product[row] += block * vector[column];
                if row != column {
                    product[column] += block.tr_mul(&vector[row]);
                }
            }
        }
        product
    }
}

/// `H δ = −g` of a cost `½ Σ r²`: the upper blocks of H and the gradient g.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// Blocks in the order of the pattern.
    pub blocks: Vec<Block>,
    /// Gradient of the cost, one vector per slot.
    pub gradient: Vec<FrameStep>,
}

impl NormalEquations {
    /// All zero.
    pub fn zeros(pattern: &Pattern) -> Self {
        Self {
            blocks: vec![Block::zeros(); pattern.blocks()],
            gradient: vec![FrameStep::zeros(); pattern.columns()],
        }
    }

    /// Adds to block (row, column) of the matrix, `row ≤ column`, which must exist.
    pub fn add_block(&mut self, pattern: &Pattern, row: usize, column: usize, block: &Block) {
        let index = pattern.block_index(row, column);
        debug_assert!(
            index.is_some(),
            "block ({row}, {column}) is not in the pattern"
        );
        if let Some(index) = index {
            self.blocks[index] += block;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pattern_has_each_pair_once_and_the_diagonal() {
        let pattern = Pattern::new(4, [(0, 2), (2, 0), (3, 1), (1, 1)]);
        assert_eq!(pattern.rows(0), [0]);
        assert_eq!(pattern.rows(2), [0, 2]);
        assert_eq!(pattern.rows(3), [1, 3]);
        assert_eq!(pattern.blocks(), 6);
        assert_eq!(pattern.block_index(1, 3), Some(4));
        assert_eq!(pattern.block_index(0, 3), None);
    }
}
