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
use crate::linear::sparse_cholesky::Factor;
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{Accum, Mat, MatRef, Par};
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
        // Z of columns and rows of fronts, until all of their children have taken theirs.
        let mut known: Vec<(usize, Mat<f64>)> = Vec::new();
        for (k, front) in fronts.all.iter().enumerate().rev() {
            let of_rows = match front.parent {
                Some(parent) => {
                    let parent = parent as usize;
                    // What is behind the parent has no children left.
                    while known.pop_if(|(of, _)| *of < parent).is_some() {}
                    let of_parent = known.last().map(|(_, z)| z.as_ref());
                    of_parent.map_or_else(Mat::new, |z| rows_of(front, &fronts.all[parent], z))
                }
                None => {
                    known.clear();
                    Mat::new()
                }
            };
            let z = inverse_of_front(factor, front, of_rows.as_ref());
            let to = values[front.start..][..front.values()].iter_mut();
            let columns = (0..front.width()).flat_map(|c| (0..z.nrows()).map(move |r| (r, c)));
            to.zip(columns).for_each(|(to, at)| *to = z[at]);
            known.push((k, z));
        }
        Self {
            fronts: fronts.clone(),
            values,
        }
    }

    /// Block (row, column) of `H⁻¹`, if it lies on the pattern of the factor.
    pub fn block(&self, row: usize, column: usize) -> Option<Block> {
        let (front, r, c, is_lower) = self.fronts.find(row, column)?;
        let front = &self.fronts.all[front];
        let height = front.width() + front.below();
        let first = front.start + c * FRAME_PARAMETERS * height + r * FRAME_PARAMETERS;
        let block = Block::from_fn(|r, c| self.values[first + c * height + r]);
        Some(if is_lower { block } else { block.transpose() })
    }
}

/// `Z_rr` of the rows of a front by the Z of its parent.
fn rows_of(front: &Front, parent: &Front, of_parent: MatRef<f64>) -> Mat<f64> {
    let places: Vec<usize> = front
        .rows
        .iter()
        .filter_map(|row| parent.index(*row))
        .flat_map(|place| (0..FRAME_PARAMETERS).map(move |k| place * FRAME_PARAMETERS + k))
        .collect();
    Mat::from_fn(places.len(), places.len(), |r, c| {
        of_parent[(places[r], places[c])]
    })
}

/// Z of columns and rows of a front by that of its rows.
fn inverse_of_front(factor: &Factor, front: &Front, of_rows: MatRef<f64>) -> Mat<f64> {
    let (own, below) = factor.panel(front);
    let (width, height) = (front.width(), front.width() + front.below());
    let mut y = below.to_owned();
    solve_upper_triangular_in_place(own.transpose(), y.as_mut().transpose_mut(), Par::Seq);
    let mut z = Mat::zeros(height, height);
    z.as_mut()
        .submatrix_mut(width, width, height - width, height - width)
        .copy_from(of_rows);
    let mut of_columns = Mat::identity(width, width);
    solve_lower_triangular_in_place(own, of_columns.as_mut(), Par::Seq);
    solve_upper_triangular_in_place(own.transpose(), of_columns.as_mut(), Par::Seq);
    let mut across = Mat::zeros(height - width, width);
    matmul(
        across.as_mut(),
        Accum::Replace,
        of_rows,
        y.as_ref(),
        -1.0,
        Par::Seq,
    );
    matmul(
        of_columns.as_mut(),
        Accum::Add,
        y.transpose(),
        across.as_ref(),
        -1.0,
        Par::Seq,
    );
    z.as_mut()
        .submatrix_mut(0, 0, width, width)
        .copy_from(&of_columns);
    z.as_mut()
        .submatrix_mut(width, 0, height - width, width)
        .copy_from(&across);
    z.as_mut()
        .submatrix_mut(0, width, width, height - width)
        .copy_from(across.transpose());
    z
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
