//! Sparse Cholesky factorisation of the normal matrix: dense ones of its fronts
//! ([`crate::linear::fronts`]), by faer.

use crate::linear::fronts::{Front, Fronts};
use crate::linear::normal_equations::{NormalEquations, Pattern};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    prelude::{Reborrow, ReborrowMut},
};
use nalgebra::SMatrix;
use std::sync::Arc;

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
    fronts: Arc<Fronts>,
}

impl SymbolicFactorisation {
    /// Analyses a pattern: order of elimination and fronts.
    ///
    /// # Errors
    /// [`FactorError::Structure`].
    pub fn new(pattern: &Pattern) -> Result<Self, FactorError> {
        let fronts = Arc::new(Fronts::new(pattern)?);
        Ok(Self { fronts })
    }

    /// Factorises `H + λ diag(H)`.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn factorise(&self, normal: &NormalEquations, lambda: f64) -> Result<Factor, FactorError> {
        self.factorise_with(normal, |_, own| own * (1.0 + lambda))
    }

    /// Factorises H with another diagonal: `diagonal_of` every slot and element of H there.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn factorise_with(
        &self,
        normal: &NormalEquations,
        diagonal_of: impl Fn(usize, f64) -> f64,
    ) -> Result<Factor, FactorError> {
        let fronts = &self.fronts;
        let mut values = vec![0.0; fronts.values()];
        // What fronts leave, until their parents take it; those of a front's children are the last.
        let mut left: Vec<(&Front, Mat<f64>)> = Vec::new();
        for (k, front) in (0..).zip(&fronts.all) {
            let panel = &mut values[front.start..][..front.values()];
            let mut panel = MatMut::from_column_major_slice_mut(
                panel,
                front.width() + front.below(),
                front.width(),
            );
            let mut update = Mat::zeros(front.below(), front.below());
            add_equations(fronts, front, normal, &diagonal_of, panel.rb_mut());
            while let Some((child, of_child)) = left.pop_if(|(child, _)| child.parent == Some(k)) {
                add_update(
                    front,
                    child,
                    of_child.as_ref(),
                    panel.rb_mut(),
                    update.as_mut(),
                );
            }
            eliminate(front, panel, update.as_mut())?;
            if front.parent.is_some() {
                left.push((front, update));
            }
        }
        Ok(Factor {
            fronts: self.fronts.clone(),
            values,
        })
    }
}

/// Adds the blocks of the normal matrix in the columns of a front, on and below the diagonal.
fn add_equations(
    fronts: &Fronts,
    front: &Front,
    normal: &NormalEquations,
    diagonal_of: &impl Fn(usize, f64) -> f64,
    mut panel: MatMut<f64>,
) {
    for place in &fronts.blocks[front.blocks.clone()] {
        let block = &normal.blocks[place.block as usize];
        let (row, column) = (usize::from(place.row), usize::from(place.column));
        let first = (row * FRAME_PARAMETERS, column * FRAME_PARAMETERS);
        let is_diagonal = row == column;
        for c in 0..FRAME_PARAMETERS {
            for r in if is_diagonal { c } else { 0 }..FRAME_PARAMETERS {
                let value = if place.is_transposed {
                    block[(c, r)]
                } else {
                    block[(r, c)]
                };
                panel[(first.0 + r, first.1 + c)] = if is_diagonal && r == c {
                    diagonal_of(fronts.slots(front)[column] as usize, value)
                } else {
                    value
                };
            }
        }
    }
}

/// Adds what a child leaves of its rows to columns (`panel`) and rows (`update`) of its parent.
fn add_update(
    front: &Front,
    child: &Front,
    of_child: MatRef<f64>,
    mut panel: MatMut<f64>,
    mut update: MatMut<f64>,
) {
    let rows = child.rows.iter().filter_map(|row| front.index(*row));
    let rows: Vec<usize> = rows.map(|row| row * FRAME_PARAMETERS).collect();
    let width = front.width();
    for (k, &column) in rows.iter().enumerate() {
        let (above, mut to) = if column < width {
            (0, panel.rb_mut().subcols_mut(column, FRAME_PARAMETERS))
        } else {
            let columns = update
                .rb_mut()
                .subcols_mut(column - width, FRAME_PARAMETERS);
            (width, columns)
        };
        let from = of_child.subcols(k * FRAME_PARAMETERS, FRAME_PARAMETERS);
        for c in 0..FRAME_PARAMETERS {
            let from = from
                .col(c)
                .try_as_col_major()
                .map(|column| column.as_slice());
            let to = to.rb_mut().col_mut(c).try_as_col_major_mut();
            let Some((from, to)) = from.zip(to.map(|column| column.as_slice_mut())) else {
                continue;
            };
            let from = from.chunks_exact(FRAME_PARAMETERS).skip(k);
            for (from, row) in from.zip(&rows[k..]) {
                let to = &mut to[row - above..][..FRAME_PARAMETERS];
                to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
            }
        }
    }
}

/// Eliminates the columns of a front: its `panel` becomes that of L, and what they leave of the
/// rows is added to `update`. Upper triangles are not used.
fn eliminate(front: &Front, panel: MatMut<f64>, update: MatMut<f64>) -> Result<(), FactorError> {
    let scratch = cholesky_in_place_scratch::<f64>(front.width(), Par::Seq, Default::default());
    let (mut own, mut below) = panel.split_at_row_mut(front.width());
    cholesky_in_place(
        own.rb_mut(),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| FactorError::NotPositiveDefinite)?;
    solve_lower_triangular_in_place(own.rb(), below.rb_mut().transpose_mut(), Par::Seq);
    triangular::matmul(
        update,
        BlockStructure::TriangularLower,
        Accum::Add,
        below.rb(),
        BlockStructure::Rectangular,
        below.rb().transpose(),
        BlockStructure::Rectangular,
        -1.0,
        Par::Seq,
    );
    Ok(())
}

/// A numeric factorisation.
pub struct Factor {
    fronts: Arc<Fronts>,
    /// Columns of L, front by front.
    values: Vec<f64>,
}

impl Factor {
    /// Structure of the factor.
    pub fn fronts(&self) -> &Arc<Fronts> {
        &self.fronts
    }

    /// Columns of a front: L of its columns, and L of the rows below.
    pub fn panel(&self, front: &Front) -> (MatRef<'_, f64>, MatRef<'_, f64>) {
        let panel = &self.values[front.start..][..front.values()];
        let width = front.width();
        MatRef::from_column_major_slice(panel, width + front.below(), width).split_at_row(width)
    }

    /// Computes `H⁻¹ B` of a matrix B with C columns, given and returned frame by frame.
    pub fn solve<const C: usize>(
        &self,
        blocks: &[SMatrix<f64, FRAME_PARAMETERS, C>],
    ) -> Vec<SMatrix<f64, FRAME_PARAMETERS, C>> {
        let mut solution = blocks.to_vec();
        for front in &self.fronts.all {
            let (own, below) = self.panel(front);
            let mut x = gather(&solution, self.fronts.slots(front).iter());
            solve_lower_triangular_in_place(own, x.as_mut(), Par::Seq);
            scatter(&mut solution, self.fronts.slots(front).iter(), x.as_ref());
            let rows = || {
                front
                    .rows
                    .iter()
                    .map(|row| &self.fronts.order[*row as usize])
            };
            let mut of_rows = gather(&solution, rows());
            matmul(
                of_rows.as_mut(),
                Accum::Add,
                below,
                x.as_ref(),
                -1.0,
                Par::Seq,
            );
            scatter(&mut solution, rows(), of_rows.as_ref());
        }
        for front in self.fronts.all.iter().rev() {
            let (own, below) = self.panel(front);
            let rows = front
                .rows
                .iter()
                .map(|row| &self.fronts.order[*row as usize]);
            let of_rows = gather(&solution, rows);
            let mut x = gather(&solution, self.fronts.slots(front).iter());
            matmul(
                x.as_mut(),
                Accum::Add,
                below.transpose(),
                of_rows.as_ref(),
                -1.0,
                Par::Seq,
            );
            solve_upper_triangular_in_place(own.transpose(), x.as_mut(), Par::Seq);
            scatter(&mut solution, self.fronts.slots(front).iter(), x.as_ref());
        }
        solution
    }

    /// `log det H`.
    pub fn log_determinant(&self) -> f64 {
        let pivots = self.fronts.all.iter().flat_map(|front| {
            let (own, _) = self.panel(front);
            (0..front.width()).map(move |k| own[(k, k)])
        });
        pivots.map(|pivot| 2.0 * pivot.ln()).sum()
    }

    /// Solves `H δ = −g` for the step δ.
    pub fn step(&self, gradient: &[FrameStep]) -> Vec<FrameStep> {
        let right: Vec<FrameStep> = gradient.iter().map(|g| -g).collect();
        self.solve(&right)
    }
}

/// Rows of some slots as one matrix.
fn gather<'s, const C: usize>(
    blocks: &[SMatrix<f64, FRAME_PARAMETERS, C>],
    slots: impl ExactSizeIterator<Item = &'s u32>,
) -> Mat<f64> {
    let mut rows = Mat::zeros(slots.len() * FRAME_PARAMETERS, C);
    for (k, slot) in slots.enumerate() {
        let block = &blocks[*slot as usize];
        for c in 0..C {
            for r in 0..FRAME_PARAMETERS {
                rows[(k * FRAME_PARAMETERS + r, c)] = block[(r, c)];
            }
        }
    }
    rows
}

/// Writes rows of some slots back.
fn scatter<'s, const C: usize>(
    blocks: &mut [SMatrix<f64, FRAME_PARAMETERS, C>],
    slots: impl Iterator<Item = &'s u32>,
    rows: MatRef<f64>,
) {
    for (k, slot) in slots.enumerate() {
        let block = &mut blocks[*slot as usize];
        for c in 0..C {
            for r in 0..FRAME_PARAMETERS {
                block[(r, c)] = rows[(k * FRAME_PARAMETERS + r, c)];
            }
        }
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
        let factor = symbolic.factorise(&normal, 0.0).unwrap();
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
        let factor = symbolic.factorise(&normal, 0.0).unwrap();
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
            symbolic.factorise(&normal, 0.0),
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
            let factor = symbolic.factorise(&normal, 0.0).unwrap();
            let factored = start.elapsed() - analysed;
            let kib = factor.values.len() * size_of::<f64>() / frames / 1024;
            println!(
                "{frames} frames: analysis {analysed:.2?}, factor {factored:.2?}, {kib} KiB a frame"
            );
        }
    }
}
