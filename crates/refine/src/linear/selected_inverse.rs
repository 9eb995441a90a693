//! Selected inversion: the blocks of `H⁻¹` on the sparsity pattern of the factor of H.
//!
//! Let `H = L D Lᵀ` with L unit lower triangular in 8 × 8 blocks, in an order of elimination that
//! leaves it sparse ([`elimination_order`]). `Z = H⁻¹` obeys `Z = D⁻¹ L⁻¹ + (I − Lᵀ) Z`
//! (Takahashi's equations). From the last column to the first, with R_j the rows of L's column j
//! below the diagonal,
//!
//! `Z_ij = −Σ_{k∈R_j} Z_ik L_kj`  (i ∈ R_j),   `Z_jj = D_j⁻¹ − Σ_{k∈R_j} L_kjᵀ Z_kj`,
//!
//! where every `Z_ik` with i, k ∈ R_j lies on the pattern of the factor. Time and memory grow
//! linearly with the length of the tunnel.
//!
//! Source: K. Takahashi, J. Fagan, M. Chin, "Formation of a sparse bus impedance matrix and its
//! application to short circuit study", 1973.

use crate::linear::elimination_order::elimination_order;
use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::linear::sparse_cholesky::FactorError;

/// Blocks of `H⁻¹` on the pattern of the factor.
pub struct SelectedInverse {
    /// Position of every slot in the order of elimination; all else is in this order.
    position: Vec<usize>,
    /// Rows of every column of L below the diagonal, ascending.
    rows: Vec<Vec<usize>>,
    /// `Z_ij` of these rows, in their order.
    below: Vec<Vec<Block>>,
    /// `Z_jj`.
    diagonal: Vec<Block>,
}

impl SelectedInverse {
    /// Factorises the normal matrix and computes the blocks of its inverse.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn new(pattern: &Pattern, normal: &NormalEquations) -> Result<Self, FactorError> {
        let count = pattern.columns();
        let place_of = elimination_order(pattern)?;
        let rows = factor_rows(pattern, &place_of);
        let position =
            |rows: &[Vec<usize>], column: usize, row: usize| rows[column].binary_search(&row).ok();
        // The lower triangle: the transposes of the pattern's upper blocks.
        let mut factor: Vec<Vec<Block>> =
            rows.iter().map(|r| vec![Block::zeros(); r.len()]).collect();
        let mut diagonal = vec![Block::zeros(); count];
        for column in 0..count {
            for &row in pattern.rows(column) {
                let Some(at) = pattern.block_index(row, column) else {
                    continue;
                };
                let block = &normal.blocks[at];
                let (i, j) = (place_of[row], place_of[column]);
                if row == column {
                    diagonal[j] = block.symmetric_upper();
                } else if let Some(at) = position(&rows, i.min(j), i.max(j)) {
                    factor[i.min(j)][at] = if i < j { block.transpose() } else { *block };
                }
            }
        }
        // Right-looking: each finished column j updates the later columns that it reaches.
        let mut inverse_pivots = Vec::with_capacity(count);
        for j in 0..count {
            let pivot = diagonal[j]
                .cholesky()
                .ok_or(FactorError::NotPositiveDefinite)?
                .inverse();
            let raw = std::mem::take(&mut factor[j]);
            let scaled: Vec<Block> = raw.iter().map(|block| block * pivot).collect();
            for (b, &column) in rows[j].iter().enumerate() {
                let transposed = raw[b].transpose();
                diagonal[column] -= scaled[b] * transposed;
                for (a, &row) in rows[j].iter().enumerate().skip(b + 1) {
                    if let Some(at) = position(&rows, column, row) {
                        factor[column][at] -= scaled[a] * transposed;
                    }
                }
            }
            factor[j] = scaled;
            inverse_pivots.push(pivot);
        }
        let mut inverse = Self {
            position: place_of,
            below: rows.iter().map(|_| Vec::new()).collect(),
            diagonal: inverse_pivots,
            rows,
        };
        for j in (0..count).rev() {
            // Each column of L gives its memory to that of the inverse.
            let factor = std::mem::take(&mut factor[j]);
            let column: Vec<Block> = inverse.rows[j]
                .iter()
                .map(|&i| {
                    let sum = inverse.rows[j].iter().zip(&factor);
                    sum.map(|(&k, l)| inverse.block_at(i, k).unwrap_or_default() * l)
                        .fold(Block::zeros(), |sum, term| sum - term)
                })
                .collect();
            for (l, z) in factor.iter().zip(&column) {
                inverse.diagonal[j] -= l.transpose() * z;
            }
            inverse.below[j] = column;
        }
        Ok(inverse)
    }

    /// Block (row, column) of `H⁻¹`, if it lies on the pattern of the factor.
    pub fn block(&self, row: usize, column: usize) -> Option<Block> {
        self.block_at(self.position[row], self.position[column])
    }

    /// The block at positions in the order of elimination.
    fn block_at(&self, row: usize, column: usize) -> Option<Block> {
        if row == column {
            return Some(self.diagonal[row]);
        }
        let (late, early) = (row.max(column), row.min(column));
        let block = self.below[early].get(self.rows[early].binary_search(&late).ok()?)?;
        Some(if row > column {
            *block
        } else {
            block.transpose()
        })
    }
}

/// Mirrors the upper triangle of a block below the diagonal; only the upper one is summed up.
trait SymmetricUpper {
    fn symmetric_upper(&self) -> Self;
}

impl SymmetricUpper for Block {
    fn symmetric_upper(&self) -> Self {
        let mut block = *self;
        block.fill_lower_triangle_with_upper_triangle();
        block
    }
}

/// Symbolic factorisation: the rows of the factor's columns below the diagonal, in the order of
/// elimination. A column has the rows of the matrix and those of its children in the elimination
/// tree.
fn factor_rows(pattern: &Pattern, place_of: &[usize]) -> Vec<Vec<usize>> {
    let count = pattern.columns();
    let mut rows: Vec<Vec<usize>> = vec![Vec::new(); count];
    for column in 0..count {
        for &row in pattern.rows(column) {
            if row < column {
                let (i, j) = (place_of[row], place_of[column]);
                rows[i.min(j)].push(i.max(j));
            }
        }
    }
    for j in 0..count {
        rows[j].sort_unstable();
        rows[j].dedup();
        if let Some((&parent, rest)) = rows[j].split_first() {
            let rest = rest.to_vec();
            rows[parent].extend(rest);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::test_dense::random_equations;
    use crate::parameters::frame_estimate::FRAME_PARAMETERS;

    #[test]
    fn blocks_agree_with_the_dense_inverse() {
        let (pattern, normal, dense) = random_equations(11, 7, 12.0);
        let inverse = SelectedInverse::new(&pattern, &normal).unwrap();
        let expected = dense.try_inverse().unwrap();
        for column in 0..pattern.columns() {
            for &row in pattern.rows(column) {
                let block = inverse.block(row, column).unwrap();
                for r in 0..FRAME_PARAMETERS {
                    for c in 0..FRAME_PARAMETERS {
                        let z =
                            expected[(row * FRAME_PARAMETERS + r, column * FRAME_PARAMETERS + c)];
                        assert!((block[(r, c)] - z).abs() < 1e-12);
                    }
                }
            }
        }
    }
}
