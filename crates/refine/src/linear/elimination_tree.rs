//! Elimination trees: which slot each column of the factor depends on.

use crate::linear::adjacency::Adjacency;

/// The elimination tree of slots in an order, and the size of the factor.
///
/// Column j of L has the rows of the matrix and those of its children, the columns whose first row
/// below the diagonal is j.
///
/// Source: J. W. H. Liu, "The role of elimination trees in sparse factorization", SIAM Journal on
/// Matrix Analysis and Applications 11(1), 1990.
pub struct EliminationTree {
    /// Slots in the order of elimination.
    order: Vec<u32>,
    /// Parent of each position in the order; None for roots.
    parents: Vec<Option<u32>>,
    /// Blocks of L.
    blocks: usize,
}

impl EliminationTree {
    /// The tree of slots that are eliminated in an order.
    pub fn new(adjacency: &Adjacency, order: Vec<u32>) -> Self {
        let mut parents = Vec::with_capacity(order.len());
        let mut blocks = 0;
        for_each_column(adjacency, &order, |rows| {
            parents.push(rows.first().copied());
            blocks += 1 + rows.len();
        });
        Self {
            order,
            parents,
            blocks,
        }
    }

    /// Number of blocks of the factor: its diagonal and what is not zero below.
    pub fn blocks(&self) -> usize {
        self.blocks
    }

    /// Slots in an order with the same factor in which the columns that each depends on are
    /// directly before it.
    pub fn postorder(&self) -> Vec<u32> {
        let mut children = vec![Vec::new(); self.order.len()];
        let mut roots = Vec::new();
        for (position, parent) in (0..).zip(&self.parents) {
            match parent {
                Some(parent) => children[*parent as usize].push(position),
                None => roots.push(position),
            }
        }
        // From the last root down, each before its children, and all of it reversed.
        let mut reversed = Vec::with_capacity(self.order.len());
        let mut waiting = roots;
        while let Some(position) = waiting.pop() {
            reversed.push(self.order[position as usize]);
            waiting.append(&mut children[position as usize]);
        }
        reversed.reverse();
        reversed
    }
}

/// Calls `visit` with the rows below the diagonal of each column of L, ascending positions in the
/// order.
pub fn for_each_column(adjacency: &Adjacency, order: &[u32], mut visit: impl FnMut(&[u32])) {
    let position = positions(order);
    let mut from_children: Vec<Vec<u32>> = vec![Vec::new(); order.len()];
    for (column, slot) in order.iter().enumerate() {
        let mut rows = std::mem::take(&mut from_children[column]);
        let neighbours = adjacency.neighbours(*slot as usize).iter();
        let neighbours = neighbours.map(|neighbour| position[*neighbour as usize]);
        rows.extend(neighbours.filter(|row| *row as usize > column));
        rows.sort_unstable();
        rows.dedup();
        visit(&rows);
        if let Some((parent, rest)) = rows.split_first() {
            from_children[*parent as usize].extend_from_slice(rest);
        }
    }
}

/// Position of each slot in an order.
pub fn positions(order: &[u32]) -> Vec<u32> {
    let mut positions = vec![0; order.len()];
    for (position, slot) in (0..).zip(order) {
        positions[*slot as usize] = position;
    }
    positions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::normal_equations::Pattern;

    #[test]
    fn fill_is_counted_and_children_come_before_their_parents() {
        // A star of which the centre is first: eliminating it connects all others.
        let adjacency = Adjacency::new(&Pattern::new(4, [(0, 1), (0, 2), (0, 3)]));
        let centre_first = EliminationTree::new(&adjacency, vec![0, 1, 2, 3]);
        assert_eq!(centre_first.blocks(), 10);
        let centre_last = EliminationTree::new(&adjacency, vec![3, 1, 2, 0]);
        assert_eq!(centre_last.blocks(), 7);
        // Two chains that are eliminated alternately.
        let chains = Adjacency::new(&Pattern::new(4, [(0, 1), (2, 3)]));
        let order = EliminationTree::new(&chains, vec![0, 2, 1, 3]).postorder();
        assert_eq!(order, [0, 1, 2, 3]);
    }
}
