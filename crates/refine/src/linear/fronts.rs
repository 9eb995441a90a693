//! Fronts: the dense matrices of which a sparse factor consists.
//!
//! Columns of L that follow each other and have nearly the same rows make a front, with the rows
//! below them, in blocks of slots. Its matrix has the columns of H, and what its children, the
//! fronts that depend on none but their own children, leave of theirs. Its columns are eliminated,
//! and what is left of its rows is handed to its parent: the front that has the first of them as a
//! column, and all others as columns or rows. So all work is products of dense matrices.
//!
//! Source: I. S. Duff, J. K. Reid, "The multifrontal solution of indefinite sparse symmetric linear
//! equations", ACM Transactions on Mathematical Software 9(3), 1983.

use crate::linear::adjacency::Adjacency;
use crate::linear::elimination_order::{minimum_degree_order, wavefront_order};
use crate::linear::elimination_tree::{EliminationTree, for_each_column, positions};
use crate::linear::factor_error::FactorError;
use crate::linear::normal_equations::Pattern;
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use std::ops::Range;

/// Zeros that columns of a front store so that they have the same rows, over the blocks that are
/// not zero. More make larger and faster products, and more of them.
const MAX_ZERO_SHARE: f64 = 0.125;

/// A front: its columns and rows by their positions in the order of elimination.
#[derive(Clone, Debug)]
pub struct Front {
    /// Positions of the columns.
    pub columns: Range<u32>,
    /// Ascending positions of the rows below the columns.
    pub rows: Vec<u32>,
    /// Index of the parent; None for a front without rows.
    pub parent: Option<u32>,
    /// Blocks of the pattern that belong to the columns.
    pub blocks: Range<usize>,
    /// First of its values in the factor.
    pub start: usize,
}

impl Front {
    /// Number of unknowns of the columns.
    pub fn width(&self) -> usize {
        self.columns.len() * FRAME_PARAMETERS
    }

    /// Number of unknowns of the rows below.
    pub fn below(&self) -> usize {
        self.rows.len() * FRAME_PARAMETERS
    }

    /// Number of unknowns of columns and rows.
    pub fn height(&self) -> usize {
        self.width() + self.below()
    }

    /// Number of values of its part of the factor: a column for each unknown of the columns.
    pub fn values(&self) -> usize {
        self.width() * self.height()
    }

    /// First unknowns, among those of the parent, of the slots of the rows.
    pub fn places_in(&self, parent: &Self) -> Vec<usize> {
        let places = self.rows.iter().filter_map(|row| parent.index(*row));
        places.map(|place| place * FRAME_PARAMETERS).collect()
    }

    /// Index of a position among columns and rows, slot by slot.
    pub fn index(&self, position: u32) -> Option<usize> {
        if self.columns.contains(&position) {
            return Some((position - self.columns.start) as usize);
        }
        let row = self.rows.binary_search(&position).ok()?;
        Some(self.columns.len() + row)
    }
}

/// A block of the pattern in a front.
#[derive(Clone, Copy, Debug)]
pub struct FrontBlock {
    /// Index in the pattern.
    pub block: u32,
    /// Place among the front's columns and rows.
    pub row: u16,
    /// Place among the front's columns.
    pub column: u16,
    /// True if the front has the transpose of the pattern's block, as below the diagonal of the
    /// slot's own block.
    pub is_transposed: bool,
}

/// The fronts of a pattern, each behind its children.
#[derive(Clone, Debug)]
pub struct Fronts {
    /// Slots in the order of elimination.
    pub order: Vec<u32>,
    /// Fronts, by ascending columns.
    pub all: Vec<Front>,
    /// Blocks of the pattern in the fronts.
    pub blocks: Vec<FrontBlock>,
    position: Vec<u32>,
    front_of: Vec<u32>,
}

impl Fronts {
    /// Analyses a pattern. Of two orders of elimination it takes the one with the smaller factor.
    ///
    /// # Errors
    /// [`FactorError::Structure`].
    pub fn new(pattern: &Pattern) -> Result<Self, FactorError> {
        let adjacency = Adjacency::new(pattern);
        let along = EliminationTree::new(&adjacency, wavefront_order(&adjacency));
        let by_degree = EliminationTree::new(&adjacency, minimum_degree_order(&adjacency)?);
        let smaller = if by_degree.blocks() < along.blocks() {
            by_degree
        } else {
            along
        };
        let order = smaller.postorder();
        let position = positions(&order);
        let mut all = merge_columns(&adjacency, &order);
        let mut front_of = Vec::with_capacity(order.len());
        for (k, front) in (0..).zip(&all) {
            front_of.resize(front.columns.end as usize, k);
        }
        for front in &mut all {
            front.parent = front.rows.first().map(|row| front_of[*row as usize]);
        }
        let mut fronts = Self {
            order,
            all,
            blocks: Vec::with_capacity(pattern.blocks()),
            position,
            front_of,
        };
        fronts.assign_blocks(pattern, &adjacency);
        Ok(fronts)
    }

    /// Number of values of the factor.
    pub fn values(&self) -> usize {
        self.all
            .last()
            .map_or(0, |front| front.start + front.values())
    }

    /// Index of a front.
    pub fn index_of(&self, front: &Front) -> usize {
        self.front_of[front.columns.start as usize] as usize
    }

    /// Slots of the columns of a front.
    pub fn slots(&self, front: &Front) -> &[u32] {
        &self.order[front.columns.start as usize..front.columns.end as usize]
    }

    /// Slots of the rows of a front.
    pub fn row_slots(&self, front: &Front) -> Vec<u32> {
        let rows = front.rows.iter();
        rows.map(|row| self.order[*row as usize]).collect()
    }

    /// Front, row and column (slot by slot) of the block of two slots in the lower triangle of the
    /// factor, and whether its row is the first slot; None if it is not there.
    pub fn find(&self, a: usize, b: usize) -> Option<(usize, usize, usize, bool)> {
        let (a, b) = (self.position[a], self.position[b]);
        let front = self.front_of[a.min(b) as usize] as usize;
        let columns = self.all[front].columns.start;
        let row = self.all[front].index(a.max(b))?;
        Some((front, row, (a.min(b) - columns) as usize, a >= b))
    }

    /// Finds the blocks of the pattern that belong to each front.
    fn assign_blocks(&mut self, pattern: &Pattern, adjacency: &Adjacency) {
        for k in 0..self.all.len() {
            let first = self.blocks.len();
            for column in self.all[k].columns.clone() {
                let slot = self.order[column as usize] as usize;
                let neighbours = adjacency
                    .neighbours(slot)
                    .iter()
                    .map(|other| *other as usize);
                for other in neighbours.chain([slot]) {
                    let at = self.position[other];
                    let block = pattern.block_index(slot.min(other), slot.max(other));
                    let row = self.all[k].index(at).filter(|_| at >= column);
                    if let Some((block, row)) = block.zip(row) {
                        self.blocks.push(FrontBlock {
                            block: block as u32,
                            row: row as u16,
                            column: (column - self.all[k].columns.start) as u16,
                            is_transposed: other >= slot,
                        });
                    }
                }
            }
            self.all[k].blocks = first..self.blocks.len();
        }
    }
}

/// Merges columns of the factor to fronts: each with its parent if that is the next column and few
/// zeros are stored.
fn merge_columns(adjacency: &Adjacency, order: &[u32]) -> Vec<Front> {
    let mut all: Vec<Front> = Vec::new();
    let mut column = 0;
    // Of the last front: blocks that are not zero.
    let mut blocks = 0;
    for_each_column(adjacency, order, |rows| {
        let own = 1 + rows.len();
        if let Some(last) = all.last_mut() {
            let width = 1 + last.columns.len();
            let stored = width * (width - 1) / 2 + width * own;
            let zeros = stored as f64 - (blocks + own) as f64;
            let is_parent = last.rows.first() == Some(&column);
            if is_parent && zeros <= MAX_ZERO_SHARE * (blocks + own) as f64 {
                last.columns.end += 1;
                last.rows = rows.to_vec();
                blocks += own;
                column += 1;
                return;
            }
        }
        all.push(Front {
            columns: column..column + 1,
            rows: rows.to_vec(),
            parent: None,
            blocks: 0..0,
            start: 0,
        });
        blocks = own;
        column += 1;
    });
    let mut start = 0;
    for front in &mut all {
        front.start = start;
        start += front.values();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::test_dense::random_equations;

    /// Each block of the pattern is in one front; rows of a front are in its parent, which is
    /// behind it.
    #[test]
    fn fronts_have_all_blocks_and_hand_their_rows_to_their_parents() {
        let (pattern, _, _) = random_equations(40, 3, 12.0);
        let fronts = Fronts::new(&pattern).unwrap();
        let mut blocks: Vec<u32> = fronts.blocks.iter().map(|block| block.block).collect();
        blocks.sort_unstable();
        assert!(blocks.into_iter().eq(0..pattern.blocks() as u32));
        assert!(fronts.all.len() > 1);
        for (k, front) in fronts.all.iter().enumerate() {
            assert_eq!(front.rows.is_empty(), front.parent.is_none());
            if let Some(parent) = front.parent {
                assert!(parent as usize > k);
                let parent = &fronts.all[parent as usize];
                assert!(front.rows.iter().all(|row| parent.index(*row).is_some()));
            }
        }
    }
}
