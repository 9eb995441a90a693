//! Neighbours of the slots of a pattern.

use crate::linear::normal_equations::Pattern;

/// For every slot the others that it shares a block with.
pub struct Adjacency {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Adjacency {
    /// The neighbours by a pattern, of less than 2³² blocks.
    pub fn new(pattern: &Pattern) -> Self {
        let slots = pattern.columns();
        let pairs = || {
            (0..slots).flat_map(|column| {
                let above = pattern
                    .rows(column)
                    .iter()
                    .filter(move |row| **row < column);
                above.map(move |row| (*row, column))
            })
        };
        let mut starts = vec![0; slots + 1];
        for (a, b) in pairs() {
            starts[a + 1] += 1;
            starts[b + 1] += 1;
        }
        for k in 0..slots {
            starts[k + 1] += starts[k];
        }
        let mut ends = starts.clone();
        let mut neighbours = vec![0; starts[slots] as usize];
        let mut add = |slot: usize, neighbour: usize| {
            neighbours[ends[slot] as usize] = neighbour as u32;
            ends[slot] += 1;
        };
        // By ascending columns the neighbours of each slot are ascending.
        for (a, b) in pairs() {
            add(b, a);
            add(a, b);
        }
        Self { starts, neighbours }
    }

    /// Number of slots.
    pub fn slots(&self) -> usize {
        self.starts.len() - 1
    }

    /// Ascending neighbours of a slot, without the slot itself.
    pub fn neighbours(&self, slot: usize) -> &[u32] {
        &self.neighbours[self.starts[slot] as usize..self.starts[slot + 1] as usize]
    }

    /// Starts of the neighbours of each slot, and the neighbours of all.
    pub fn compressed(&self) -> (&[u32], &[u32]) {
        (&self.starts, &self.neighbours)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_those_of_rows_and_columns() {
        let adjacency = Adjacency::new(&Pattern::new(4, [(0, 2), (3, 1), (1, 2)]));
        assert_eq!(adjacency.neighbours(0), [2]);
        assert_eq!(adjacency.neighbours(1), [2, 3]);
        assert_eq!(adjacency.neighbours(2), [0, 1]);
        assert_eq!(adjacency.neighbours(3), [1]);
    }
}
