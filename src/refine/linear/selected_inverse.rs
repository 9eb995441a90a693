//! Blocks of the inverse of the normal matrix where its factor has blocks, without the rest.
//!
//! With `H = L D Lᵀ` (L unit lower triangular in 8 × 8 blocks, in the frames' own order, in which
//! the matrix is banded), `Z = H⁻¹` obeys `Z = D⁻¹ L⁻¹ + (I − Lᵀ) Z`, so that from the last column
//! to the first, over the rows R_j of L's column j,
//!
//! `Z_ij = −Σ_{k∈R_j} Z_ik L_kj`  (i ∈ R_j),   `Z_jj = D_j⁻¹ − Σ_{k∈R_j} L_kjᵀ Z_kj`,
//!
//! and every `Z_ik` with i, k ∈ R_j is itself among the blocks of the factor. Work and memory grow
//! with the number of frames, not with its square.
//!
//! Source: K. Takahashi, J. Fagan, M. Chin, "Formation of a sparse bus impedance matrix and its
//! application to short circuit study", 1973.

use crate::refine::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::refine::linear::sparse_cholesky::FactorError;

/// Blocks of `H⁻¹`.
pub struct SelectedInverse {
    /// Rows of every column of L below the diagonal, ascending.
    rows: Vec<Vec<usize>>,
    /// `Z_ij` for those, in the same order.
    below: Vec<Vec<Block>>,
    /// `Z_jj`.
    diagonal: Vec<Block>,
}

impl SelectedInverse {
    /// Factorises the normal matrix and inverts it where the factor has blocks.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn new(pattern: &Pattern, normal: &NormalEquations) -> Result<Self, FactorError> {
        let count = pattern.frames();
        let rows = fill(pattern);
        let place =
            |rows: &[Vec<usize>], column: usize, row: usize| rows[column].binary_search(&row).ok();
        // The lower triangle: the transposes of the pattern's upper blocks.
        let mut factor: Vec<Vec<Block>> =
            rows.iter().map(|r| vec![Block::zeros(); r.len()]).collect();
        let mut diagonal = vec![Block::zeros(); count];
        for (column, pivot) in diagonal.iter_mut().enumerate() {
            for &row in pattern.rows(column) {
                let Some(at) = pattern.place(row, column) else {
                    continue;
                };
                let block = &normal.blocks[at];
                if row == column {
                    *pivot = block.symmetric_upper();
                } else if let Some(at) = place(&rows, row, column) {
                    factor[row][at] = block.transpose();
                }
            }
        }
        // Right-looking: column j, once done, is taken off all later ones it reaches.
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
                    if let Some(at) = place(&rows, column, row) {
                        factor[column][at] -= scaled[a] * transposed;
                    }
                }
            }
            factor[j] = scaled;
            inverse_pivots.push(pivot);
        }
        let mut inverse = Self {
            below: rows.iter().map(|_| Vec::new()).collect(),
            diagonal: inverse_pivots,
            rows,
        };
        for j in (0..count).rev() {
            let column: Vec<Block> = inverse.rows[j]
                .iter()
                .map(|&i| {
                    let sum = inverse.rows[j].iter().zip(&factor[j]);
                    sum.map(|(&k, l)| inverse.block(i, k).unwrap_or_default() * l)
                        .fold(Block::zeros(), |sum, term| sum - term)
                })
                .collect();
            for (l, z) in factor[j].iter().zip(&column) {
                inverse.diagonal[j] -= l.transpose() * z;
            }
            inverse.below[j] = column;
        }
        Ok(inverse)
    }

    /// Block (row, column) of `H⁻¹`, if the factor has one there.
    pub fn block(&self, row: usize, column: usize) -> Option<Block> {
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

/// The upper triangle mirrored below: sums were only kept above.
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

/// Rows of the factor's columns below the diagonal: those of the matrix, and of every column that
/// hands its rows on (to the first of them).
fn fill(pattern: &Pattern) -> Vec<Vec<usize>> {
    let count = pattern.frames();
    let mut rows: Vec<Vec<usize>> = vec![Vec::new(); count];
    for column in 0..count {
        for &row in pattern.rows(column) {
            if row < column {
                rows[row].push(column);
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
    use crate::refine::parameters::frame_estimate::UNKNOWNS;

    #[test]
    fn blocks_agree_with_the_dense_inverse() {
        let frames = 11;
        let pairs = (0..frames).flat_map(|k| [(k, (k + 1).min(10)), (k, (k + 4).min(10))]);
        let pattern = Pattern::new(frames, pairs);
        let mut normal = NormalEquations::zeros(&pattern);
        let n = frames * UNKNOWNS;
        let mut dense = nalgebra::DMatrix::zeros(n, n);
        let mut seed = 7u32;
        let mut random = || {
            seed = seed.wrapping_mul(1664525).wrapping_add(1013904223);
            f64::from(seed >> 8) / f64::from(1 << 24) - 0.5
        };
        for column in 0..frames {
            for &row in pattern.rows(column) {
                let mut block = Block::from_fn(|_, _| random());
                if row == column {
                    block = block * block.transpose() + Block::identity() * 12.0;
                }
                normal.add_block(&pattern, row, column, &block);
                for r in 0..UNKNOWNS {
                    for c in 0..UNKNOWNS {
                        dense[(row * UNKNOWNS + r, column * UNKNOWNS + c)] = block[(r, c)];
                        dense[(column * UNKNOWNS + c, row * UNKNOWNS + r)] = block[(r, c)];
                    }
                }
            }
        }
        let inverse = SelectedInverse::new(&pattern, &normal).unwrap();
        let expected = dense.try_inverse().unwrap();
        for column in 0..frames {
            for &row in pattern.rows(column) {
                let block = inverse.block(row, column).unwrap();
                for r in 0..UNKNOWNS {
                    for c in 0..UNKNOWNS {
                        let z = expected[(row * UNKNOWNS + r, column * UNKNOWNS + c)];
                        assert!((block[(r, c)] - z).abs() < 1e-12);
                    }
                }
            }
        }
        assert!(inverse.block(0, 10).is_none());
    }
}
