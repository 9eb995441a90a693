//! Fill-reducing order of elimination of the slots of a pattern.

use crate::linear::normal_equations::Pattern;
use crate::linear::sparse_cholesky::FactorError;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::amd;

/// Position of every slot in the approximate minimum degree order.
///
/// Source: P. R. Amestoy, T. A. Davis, I. S. Duff, "An approximate minimum degree ordering
/// algorithm", SIAM Journal on Matrix Analysis and Applications 17(4), 1996.
///
/// # Errors
/// [`FactorError::Structure`].
pub fn elimination_order(pattern: &Pattern) -> Result<Vec<usize>, FactorError> {
    let n = pattern.columns();
    let mut starts = Vec::with_capacity(n + 1);
    let mut rows = Vec::with_capacity(pattern.blocks());
    starts.push(0);
    for column in 0..n {
        rows.extend_from_slice(pattern.rows(column));
        starts.push(rows.len());
    }
    let scratch = amd::order_scratch::<usize>(n, rows.len());
    let structure = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
    let (mut order, mut position) = (vec![0; n], vec![0; n]);
    amd::order(
        &mut order,
        &mut position,
        structure.as_ref(),
        amd::Control::default(),
        MemStack::new(&mut MemBuffer::new(scratch)),
    )
    .map_err(|error| FactorError::Structure(format!("{error:?}")))?;
    Ok(position)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slot_has_its_position_and_what_touches_all_comes_last() {
        let star = (1..9).map(|k| (0, k));
        let position = elimination_order(&Pattern::new(9, star)).unwrap();
        let mut sorted = position.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..9).collect::<Vec<_>>());
        assert!(position[0] >= 7, "{position:?}");
    }
}
