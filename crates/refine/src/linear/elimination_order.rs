//! Orders of elimination of the slots of a pattern that leave their factor sparse.

use crate::linear::adjacency::Adjacency;
use crate::linear::factor_error::FactorError;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::amd;

/// The slots in the approximate minimum degree order.
///
/// Source: P. R. Amestoy, T. A. Davis, I. S. Duff, "An approximate minimum degree ordering
/// algorithm", SIAM Journal on Matrix Analysis and Applications 17(4), 1996.
///
/// # Errors
/// [`FactorError::Structure`].
pub fn minimum_degree_order(adjacency: &Adjacency) -> Result<Vec<u32>, FactorError> {
    let n = adjacency.slots();
    let (starts, neighbours) = adjacency.compressed();
    let scratch = amd::order_scratch::<u32>(n, neighbours.len());
    let structure =
        SymbolicSparseColMat::new_checked(n, n, starts.to_vec(), None, neighbours.to_vec());
    let (mut order, mut position) = (vec![0; n], vec![0; n]);
    amd::order(
        &mut order,
        &mut position,
        structure.as_ref(),
        amd::Control::default(),
        MemStack::new(&mut MemBuffer::new(scratch)),
    )
    .map_err(|error| FactorError::Structure(format!("{error:?}")))?;
    Ok(order)
}

/// The slots in an order with a small wavefront, which are the slots that are not eliminated but
/// have eliminated neighbours: next is that slot of the wavefront which brings the fewest others
/// into it, and of several the one that has been in it for the longest. It begins with the first
/// slot. Along a tunnel the wavefront moves from one end to the other.
///
/// Source: I. P. King, "An automatic reordering scheme for simultaneous equations derived from
/// network systems", International Journal for Numerical Methods in Engineering 2(4), 1970.
pub fn wavefront_order(adjacency: &Adjacency) -> Vec<u32> {
    let n = adjacency.slots();
    let mut order = Vec::with_capacity(n);
    let mut is_met = vec![false; n];
    let mut unmet: Vec<usize> = (0..n).map(|k| adjacency.neighbours(k).len()).collect();
    let mut wavefront: Vec<u32> = Vec::new();
    let mut meet = |slot: u32, wavefront: &mut Vec<u32>, unmet: &mut [usize]| {
        if !std::mem::replace(&mut is_met[slot as usize], true) {
            wavefront.push(slot);
            for &neighbour in adjacency.neighbours(slot as usize) {
                unmet[neighbour as usize] -= 1;
            }
        }
    };
    for first in 0..n as u32 {
        meet(first, &mut wavefront, &mut unmet);
        loop {
            let next = (0..wavefront.len()).min_by_key(|k| unmet[wavefront[*k] as usize]);
            let Some(next) = next else { break };
            let slot = wavefront.remove(next);
            for &neighbour in adjacency.neighbours(slot as usize) {
                meet(neighbour, &mut wavefront, &mut unmet);
            }
            order.push(slot);
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::normal_equations::Pattern;

    #[test]
    fn every_slot_has_its_position_and_what_touches_all_comes_last() {
        let star = Adjacency::new(&Pattern::new(9, (1..9).map(|k| (0, k))));
        let order = minimum_degree_order(&star).unwrap();
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..9).collect::<Vec<_>>());
        assert!(order[7..].contains(&0), "{order:?}");
    }

    /// A chain with one slot behind it that touches the first two, and a slot by itself.
    #[test]
    fn wavefront_follows_a_chain_and_takes_what_it_has_passed() {
        let pairs = [(0, 1), (1, 2), (2, 3), (0, 4), (1, 4)];
        let order = wavefront_order(&Adjacency::new(&Pattern::new(6, pairs)));
        assert_eq!(order, [0, 4, 1, 2, 3, 5]);
    }
}
