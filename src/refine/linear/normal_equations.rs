//! The normal equations: a symmetric block-sparse matrix and a gradient.

use crate::refine::parameters::frame_estimate::{FrameStep, UNKNOWNS};
use nalgebra::SMatrix;

/// One block of the normal matrix.
pub type Block = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Which blocks of the upper triangle exist: for every block column the ascending rows up to the
/// diagonal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    rows: Vec<Vec<usize>>,
    starts: Vec<usize>,
}

impl Pattern {
    /// The pattern of `frames` unknown frames whose `pairs` (any order, repeated or not) interact;
    /// the diagonal always exists.
    pub fn new(frames: usize, pairs: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let mut rows: Vec<Vec<usize>> = (0..frames).map(|k| vec![k]).collect();
        for (a, b) in pairs {
            rows[a.max(b)].push(a.min(b));
        }
        let mut starts = Vec::with_capacity(frames);
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
    pub fn frames(&self) -> usize {
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

    /// Place of block (row, column) among all blocks, if it exists; `row ≤ column`.
    pub fn place(&self, row: usize, column: usize) -> Option<usize> {
        let found = self.rows[column].binary_search(&row).ok()?;
        Some(self.starts[column] + found)
    }
}

/// `H δ = −g` of a cost `½ Σ r²`: the upper blocks of H and the gradient g.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// Blocks in the order of the pattern.
    pub blocks: Vec<Block>,
    /// Gradient of the cost, one step-sized piece a frame.
    pub gradient: Vec<FrameStep>,
}

impl NormalEquations {
    /// All zero.
    pub fn zeros(pattern: &Pattern) -> Self {
        Self {
            blocks: vec![Block::zeros(); pattern.blocks()],
            gradient: vec![FrameStep::zeros(); pattern.frames()],
        }
    }

    /// Adds to block (row, column) of the matrix, `row ≤ column`, which must exist.
    pub fn add_block(&mut self, pattern: &Pattern, row: usize, column: usize, block: &Block) {
        let place = pattern.place(row, column);
        debug_assert!(
            place.is_some(),
            "block ({row}, {column}) is not in the pattern"
        );
        if let Some(place) = place {
            self.blocks[place] += block;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pattern_holds_pairs_once_and_the_diagonal() {
        let pattern = Pattern::new(4, [(0, 2), (2, 0), (3, 1), (1, 1)]);
        assert_eq!(pattern.rows(0), [0]);
        assert_eq!(pattern.rows(2), [0, 2]);
        assert_eq!(pattern.rows(3), [1, 3]);
        assert_eq!(pattern.blocks(), 6);
        assert_eq!(pattern.place(1, 3), Some(4));
        assert_eq!(pattern.place(0, 3), None);
    }
}
