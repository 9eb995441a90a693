//! Selected inversion: the blocks of `H⁻¹` on the sparsity pattern of the factor of H.
//!
//! With `H = L Lᵀ` and `Z = H⁻¹`, `Lᵀ Z = L⁻¹` ties what Z has in the columns c of a front to what
//! it has in the rows r below them (Takahashi's equations):
//!
//! `Z_rc = −Z_rr Y`,   `Z_cc = (L_cc L_ccᵀ)⁻¹ − Yᵀ Z_rc`,   `Y = L_rc L_cc⁻¹`,
//!
//! where `Z_rr` is known from the front's parent, which has all rows as columns or rows. So Z goes
//! from the last front to the first. Time and memory grow linearly with the length of the tunnel.
//!
//! Source: K. Takahashi, J. Fagan, M. Chin, "Formation of a sparse bus impedance matrix and its
//! application to short circuit study", 1973.

use crate::linear::fronts::{Front, Fronts};
use crate::linear::normal_equations::Block;
use crate::linear::sparse_cholesky::{Factor, Panel};
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use std::sync::Arc;

/// Blocks of `H⁻¹` on the pattern of the factor.
pub struct SelectedInverse {
    fronts: Arc<Fronts>,
    /// Columns of `H⁻¹`, front by front, as those of the factor.
    values: Vec<f64>,
}

impl SelectedInverse {
    /// Computes the blocks of the inverse of a factorised matrix.
    pub fn new(factor: &Factor) -> Self {
        let fronts = factor.fronts();
        let mut values = vec![0.0; fronts.values()];
        let mut children = vec![0; fronts.all.len()];
        for parent in fronts.all.iter().filter_map(|front| front.parent) {
            children[parent as usize] += 1;
        }
        // Z of columns and rows of fronts whose children have not all taken theirs; the last is
        // the parent of the front that is next.
        let mut known: Vec<Mat<f64>> = Vec::new();
        factor.for_each_front_reversed(|front, panel| {
            let mut z = Mat::zeros(front.height(), front.height());
            if let (Some(parent), Some(of_parent)) = (front.parent, known.last()) {
                let parent = parent as usize;
                copy_rows(front, &fronts.all[parent], of_parent.as_ref(), z.as_mut());
                children[parent] -= 1;
                if children[parent] == 0 {
                    known.pop();
                }
            }
            add_columns(front, panel, z.as_mut());
            let panel = &mut values[front.start..][..front.values()];
            MatMut::from_column_major_slice_mut(panel, front.height(), front.width())
                .copy_from(z.as_ref().subcols(0, front.width()));
            if children[fronts.index_of(front)] > 0 {
                known.push(z);
            }
        });
        Self {
            fronts: fronts.clone(),
            values,
        }
    }

    /// Block (row, column) of `H⁻¹`, if it lies on the pattern of the factor.
    pub fn block(&self, row: usize, column: usize) -> Option<Block> {
        let (front, r, c, is_lower) = self.fronts.find(row, column)?;
        let front = &self.fronts.all[front];
        let height = front.height();
        let first = front.start + c * FRAME_PARAMETERS * height + r * FRAME_PARAMETERS;
        let block = Block::from_fn(|r, c| self.values[first + c * height + r]);
        Some(if is_lower { block } else { block.transpose() })
    }
}

/// Copies `Z_rr` of the rows of a front from the Z of its parent.
fn copy_rows(front: &Front, parent: &Front, of_parent: MatRef<f64>, mut z: MatMut<f64>) {
    let places: Vec<usize> = front.places_in(parent);
    let size = FRAME_PARAMETERS;
    for (k, &column) in places.iter().enumerate() {
        for (r, &row) in places.iter().enumerate() {
            z.rb_mut()
                .submatrix_mut(
                    front.width() + r * size,
                    front.width() + k * size,
                    size,
                    size,
                )
                .copy_from(of_parent.submatrix(row, column, size, size));
        }
    }
}

/// Completes Z of a front, of which that of its rows is known.
fn add_columns(front: &Front, (own, below): Panel, z: MatMut<f64>) {
    let mut y = below.to_owned();
    solve_upper_triangular_in_place(own.transpose(), y.as_mut().transpose_mut(), Par::Seq);
    let (mut of_columns, mut above, mut across, of_rows) =
        z.split_at_mut(front.width(), front.width());
    matmul(
        across.rb_mut(),
        Accum::Replace,
        of_rows.rb(),
        y.as_ref(),
        -1.0,
        Par::Seq,
    );
    above.copy_from(across.rb().transpose());
    of_columns.fill(0.0);
    of_columns.rb_mut().diagonal_mut().fill(1.0);
    solve_lower_triangular_in_place(own, of_columns.rb_mut(), Par::Seq);
    solve_upper_triangular_in_place(own.transpose(), of_columns.rb_mut(), Par::Seq);
    matmul(
        of_columns,
        Accum::Add,
        y.transpose(),
        across.rb(),
        -1.0,
        Par::Seq,
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::sparse_cholesky::SymbolicFactorisation;
    use crate::linear::test_dense::random_equations;

    #[test]
    fn blocks_agree_with_the_dense_inverse() {
        let (pattern, normal, dense) = random_equations(60, 7, 12.0);
        let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
        let inverse = SelectedInverse::new(&symbolic.factorise(&normal, 0.0).unwrap());
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
