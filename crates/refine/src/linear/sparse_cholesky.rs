//! Sparse Cholesky factorisation of the normal matrix, by faer.

use crate::linear::normal_equations::{NormalEquations, Pattern};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use nalgebra::SMatrix;

/// Failures of the factorisation of the normal matrix.
#[derive(Clone, Debug, thiserror::Error)]
pub enum FactorError {
    /// The matrix is not positive definite: neither pixels nor prior constrain some parameter.
    #[error("the normal matrix is not positive definite")]
    NotPositiveDefinite,
    /// The symbolic analysis failed (the matrix is too large for memory).
    #[error("the normal matrix could not be analysed: {0}")]
    Structure(String),
}

/// The symbolic factorisation of a pattern: computed once, used for every step.
///
/// faer runs sequentially (`Par::Seq`): this is faster at these sizes, and its parallel sums would
/// depend on the number of threads.
#[derive(Debug)]
pub struct SymbolicFactorisation {
    structure: SymbolicSparseColMat<usize>,
    cholesky: SymbolicCholesky<usize>,
}

impl SymbolicFactorisation {
    /// Analyses a pattern: fill-reducing order (approximate minimum degree), elimination tree and
    /// supernodes.
    ///
    /// # Errors
    /// [`FactorError::Structure`].
    pub fn new(pattern: &Pattern) -> Result<Self, FactorError> {
        let n = pattern.columns() * FRAME_PARAMETERS;
        let mut column_starts = Vec::with_capacity(n + 1);
        let mut row_indices =
            Vec::with_capacity(pattern.blocks() * FRAME_PARAMETERS * FRAME_PARAMETERS);
        column_starts.push(0);
        for column in 0..pattern.columns() {
            for c in 0..FRAME_PARAMETERS {
                for &row in pattern.rows(column) {
                    let height = if row == column {
                        c + 1
                    } else {
                        FRAME_PARAMETERS
                    };
                    row_indices.extend((0..height).map(|r| row * FRAME_PARAMETERS + r));
                }
                column_starts.push(row_indices.len());
            }
        }
        let structure = SymbolicSparseColMat::new_checked(n, n, column_starts, None, row_indices);
        let cholesky = factorize_symbolic_cholesky(
            structure.as_ref(),
            Side::Upper,
            SymmetricOrdering::Amd,
            Default::default(),
        )
        .map_err(|error| FactorError::Structure(format!("{error:?}")))?;
        Ok(Self {
            structure,
            cholesky,
        })
    }

    /// Factorises `H + λ diag(H)`.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn factorise(
        &self,
        pattern: &Pattern,
        normal: &NormalEquations,
        lambda: f64,
    ) -> Result<Factor<'_>, FactorError> {
        self.factorise_with(pattern, normal, |_, own| own * (1.0 + lambda))
    }

    /// Factorises H with another diagonal: `diagonal_of` every slot and element of H there.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn factorise_with(
        &self,
        pattern: &Pattern,
        normal: &NormalEquations,
        diagonal_of: impl Fn(usize, f64) -> f64,
    ) -> Result<Factor<'_>, FactorError> {
        let mut values = Vec::with_capacity(self.structure.row_idx().len());
        for column in 0..pattern.columns() {
            // The blocks of a column follow each other, the one on the diagonal last.
            let Some(diagonal) = pattern.block_index(column, column) else {
                continue;
            };
            let first = diagonal + 1 - pattern.rows(column).len();
            let above = &normal.blocks[first..diagonal];
            for c in 0..FRAME_PARAMETERS {
                for block in above {
                    values.extend_from_slice(block.column(c).as_slice());
                }
                let own = &normal.blocks[diagonal];
                values.extend_from_slice(&own.column(c).as_slice()[..c]);
                values.push(diagonal_of(column, own[(c, c)]));
            }
        }
        let matrix = SparseColMatRef::new(self.structure.as_ref(), &values);
        let mut numeric = vec![0.0; self.cholesky.len_val()];
        let scratch = self
            .cholesky
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        self.cholesky
            .factorize_numeric_llt(
                &mut numeric,
                matrix,
                Side::Upper,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(scratch)),
                Default::default(),
            )
            .map_err(|_| FactorError::NotPositiveDefinite)?;
        Ok(Factor {
            symbolic: &self.cholesky,
            numeric,
        })
    }
}

/// A numeric factorisation.
pub struct Factor<'a> {
    symbolic: &'a SymbolicCholesky<usize>,
    numeric: Vec<f64>,
}

impl Factor<'_> {
    /// Solves for `columns` right-hand sides at once, in place; `rhs` is column-major.
    fn solve_in_place(&self, rhs: &mut [f64], columns: usize) {
        let n = self.symbolic.nrows();
        let scratch = self
            .symbolic
            .solve_in_place_scratch::<f64>(columns, Par::Seq);
        LltRef::new(self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(rhs, n, columns),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }

    /// Computes `H⁻¹ B` of a matrix B with C columns, given and returned frame by frame.
    pub fn solve<const C: usize>(
        &self,
        blocks: &[SMatrix<f64, FRAME_PARAMETERS, C>],
    ) -> Vec<SMatrix<f64, FRAME_PARAMETERS, C>> {
        let n = blocks.len() * FRAME_PARAMETERS;
        let mut rhs = Vec::with_capacity(n * C);
        for column in 0..C {
            rhs.extend(
                blocks
                    .iter()
                    .flat_map(|b| b.column(column).into_owned().data.0[0]),
            );
        }
        self.solve_in_place(&mut rhs, C);
        let value = |frame: usize, row: usize, column: usize| {
            rhs[column * n + frame * FRAME_PARAMETERS + row]
        };
        (0..blocks.len())
            .map(|frame| SMatrix::from_fn(|row, column| value(frame, row, column)))
            .collect()
    }

    /// `log det H`.
    pub fn log_determinant(&self) -> f64 {
        let logarithms = |diagonal: &mut dyn Iterator<Item = f64>| -> f64 {
            diagonal.map(|pivot| 2.0 * pivot.ln()).sum()
        };
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(symbolic) => {
                let pivots = &symbolic.col_ptr()[..symbolic.ncols()];
                logarithms(&mut pivots.iter().map(|at| self.numeric[*at]))
            }
            SymbolicCholeskyRaw::Supernodal(symbolic) => {
                let factor = SupernodalLltRef::new(symbolic, &self.numeric);
                let supernodes = (0..symbolic.n_supernodes()).map(|k| factor.supernode(k).val());
                supernodes
                    .map(|values| logarithms(&mut (0..values.ncols()).map(|k| values[(k, k)])))
                    .sum()
            }
        }
    }

    /// Solves `H δ = −g` for the step δ.
    pub fn step(&self, gradient: &[FrameStep]) -> Vec<FrameStep> {
        let mut rhs: Vec<f64> = gradient.iter().flat_map(|g| g.iter().map(|v| -v)).collect();
        self.solve_in_place(&mut rhs, 1);
        rhs.chunks_exact(FRAME_PARAMETERS)
            .map(FrameStep::from_column_slice)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::normal_equations::Block;
    use crate::linear::test_dense::random_equations;

    fn example() -> (Pattern, NormalEquations, nalgebra::DMatrix<f64>) {
        random_equations(9, 1, 20.0)
    }

    #[test]
    fn steps_solve_the_equations() {
        let (pattern, normal, dense) = example();
        let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
        let factor = symbolic.factorise(&pattern, &normal, 0.0).unwrap();
        let step: Vec<f64> = factor
            .step(&normal.gradient)
            .iter()
            .flat_map(|s| s.iter().copied().collect::<Vec<_>>())
            .collect();
        let gradient: Vec<f64> = normal
            .gradient
            .iter()
            .flat_map(|s| s.iter().copied().collect::<Vec<_>>())
            .collect();
        let residual =
            &dense * nalgebra::DVector::from_vec(step) + nalgebra::DVector::from_vec(gradient);
        assert!(residual.norm() < 1e-10);
    }

    #[test]
    fn log_determinant_is_that_of_the_dense_matrix() {
        let (pattern, normal, dense) = example();
        let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
        let factor = symbolic.factorise(&pattern, &normal, 0.0).unwrap();
        let l = dense.cholesky().unwrap().l();
        let expected: f64 = l.diagonal().iter().map(|pivot| 2.0 * pivot.ln()).sum();
        assert!((factor.log_determinant() - expected).abs() < 1e-9);
    }

    #[test]
    fn indefinite_matrix_is_an_error() {
        let pattern = Pattern::new(1, []);
        let mut normal = NormalEquations::zeros(&pattern);
        normal.add_block(&pattern, 0, 0, &-Block::identity());
        let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
        assert!(matches!(
            symbolic.factorise(&pattern, &normal, 0.0),
            Err(FactorError::NotPositiveDefinite)
        ));
    }

    /// Prints time and size of the factor of long tunnels, twelve frames a turn, each of which
    /// overlaps with two on either side and with three of each of the three turns beside.
    #[test]
    #[ignore = "a measurement"]
    fn factor_of_a_long_tunnel() {
        for frames in [10_000, 20_000, 40_000] {
            let offsets = [1, 2, 11, 12, 13, 23, 24, 25, 35, 36, 37];
            let pairs = (0..frames).flat_map(|column: usize| {
                let rows = offsets.iter().filter_map(move |by| column.checked_sub(*by));
                rows.map(move |row| (row, column))
            });
            let pattern = Pattern::new(frames, pairs);
            let mut normal = NormalEquations::zeros(&pattern);
            for column in 0..frames {
                for &row in pattern.rows(column) {
                    let own = if row == column { 30.0 } else { -1.0 };
                    normal.add_block(&pattern, row, column, &(Block::identity() * own));
                }
            }
            let start = std::time::Instant::now();
            let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
            let analysed = start.elapsed();
            let factor = symbolic.factorise(&pattern, &normal, 0.0).unwrap();
            let factored = start.elapsed() - analysed;
            let kib = factor.numeric.len() * size_of::<f64>() / frames / 1024;
            println!(
                "{frames} frames: analysis {analysed:.2?}, factor {factored:.2?}, {kib} KiB a frame"
            );
        }
    }
}
