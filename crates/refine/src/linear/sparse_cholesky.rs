//! Sparse Cholesky factorisation of the normal matrix: dense ones of its fronts
//! ([`crate::linear::fronts`]), by faer.

use crate::linear::factor_error::FactorError;
use crate::linear::front_elimination::{FrontElimination, Matrix, Remainders};
use crate::linear::fronts::{Front, Fronts};
use crate::linear::normal_equations::{NormalEquations, Pattern};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{Accum, Mat, MatRef, Par};
use nalgebra::SMatrix;
use std::ops::Range;
use std::sync::Arc;

/// Values of L that are in memory at a time, 32 MiB.
const MAX_VALUES: usize = 1 << 22;

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
    pub fn factorise<'n>(
        &self,
        normal: &'n NormalEquations,
        lambda: f64,
    ) -> Result<Factor<'n>, FactorError> {
        self.factorise_with(normal, |_, own| own * (1.0 + lambda))
    }

    /// Factorises H with another diagonal: `diagonal_of` every slot and element of H there.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn factorise_with<'n>(
        &self,
        normal: &'n NormalEquations,
        diagonal_of: impl Fn(usize, f64) -> f64,
    ) -> Result<Factor<'n>, FactorError> {
        self.factorise_within(MAX_VALUES, normal, diagonal_of)
    }

    /// Factorises H with another diagonal, and with `max_values` of L in memory at a time.
    fn factorise_within<'n>(
        &self,
        max_values: usize,
        normal: &'n NormalEquations,
        diagonal_of: impl Fn(usize, f64) -> f64,
    ) -> Result<Factor<'n>, FactorError> {
        let fronts = &self.fronts;
        let mut diagonal = vec![FrameStep::zeros(); fronts.order.len()];
        for front in &fronts.all {
            let blocks = fronts.blocks[front.blocks.clone()].iter();
            for place in blocks.filter(|place| place.row == place.column) {
                let slot = fronts.slots(front)[usize::from(place.column)] as usize;
                let of_normal = normal.blocks[place.block as usize].diagonal();
                diagonal[slot] = of_normal.map(|own| diagonal_of(slot, own));
            }
        }
        let matrix = Matrix {
            normal,
            diagonal: &diagonal,
        };
        let mut elimination = FrontElimination::new(fronts, matrix, 0, Remainders::new());
        let mut log_determinant = 0.0;
        let mut stretches = Vec::new();
        let mut values = Vec::new();
        for range in stretches_of(fronts, max_values) {
            let left = elimination.left().clone();
            values.resize(values_of(&fronts.all[range.clone()]), 0.0);
            let mut panels = &mut values[..];
            for front in &fronts.all[range.clone()] {
                let panel = panels.split_off_mut(..front.values()).unwrap_or_default();
                elimination.eliminate_next(panel)?;
                let pivots = panel.iter().step_by(front.height() + 1);
                log_determinant += pivots.map(|pivot| 2.0 * pivot.ln()).sum::<f64>();
            }
            stretches.push((range, left));
        }
        Ok(Factor {
            fronts: fronts.clone(),
            normal,
            panels: (stretches.len() == 1).then_some(values),
            stretches,
            diagonal,
            log_determinant,
        })
    }
}

/// Fronts that follow each other and have `max_values` at the most, or are one.
fn stretches_of(fronts: &Fronts, max_values: usize) -> Vec<Range<usize>> {
    let mut stretches: Vec<Range<usize>> = Vec::new();
    let mut values = 0;
    for (k, front) in fronts.all.iter().enumerate() {
        values += front.values();
        match stretches.last_mut() {
            Some(last) if values <= max_values => last.end = k + 1,
            _ => {
                values = front.values();
                stretches.push(k..k + 1);
            }
        }
    }
    stretches
}

/// Number of values of some fronts.
fn values_of(fronts: &[Front]) -> usize {
    fronts.iter().map(Front::values).sum()
}

/// A numeric factorisation.
///
/// A large L is not kept: what fronts leave at the beginning of a stretch of them is, from which
/// the columns of the stretch are computed again, in less time than it takes to fill the memory of
/// all of them.
pub struct Factor<'n> {
    fronts: Arc<Fronts>,
    normal: &'n NormalEquations,
    diagonal: Vec<FrameStep>,
    /// Stretches of fronts, each with what those before it leave.
    stretches: Vec<(Range<usize>, Remainders)>,
    /// Columns of L, front by front, if there is one stretch.
    panels: Option<Vec<f64>>,
    log_determinant: f64,
}

/// Columns of a front of L: those rows that are columns as well, and the rows below.
pub type Panel<'f> = (MatRef<'f, f64>, MatRef<'f, f64>);

impl Factor<'_> {
    /// Structure of the factor.
    pub fn fronts(&self) -> &Arc<Fronts> {
        &self.fronts
    }

    /// Calls `visit` with every front and its columns of L, in the order of elimination.
    pub fn for_each_front(&self, mut visit: impl FnMut(&Front, Panel)) {
        let mut memory = Vec::new();
        for stretch in &self.stretches {
            let values = self.panels_of(stretch, &mut memory);
            for front in &self.fronts.all[stretch.0.clone()] {
                visit(front, self.panel(front, stretch, values));
            }
        }
    }

    /// Calls `visit` with every front and its columns of L, the last one first.
    pub fn for_each_front_reversed(&self, mut visit: impl FnMut(&Front, Panel)) {
        let mut memory = Vec::new();
        for stretch in self.stretches.iter().rev() {
            let values = self.panels_of(stretch, &mut memory);
            for front in self.fronts.all[stretch.0.clone()].iter().rev() {
                visit(front, self.panel(front, stretch, values));
            }
        }
    }

    /// Columns of L of a stretch, computed in `memory` if they are not kept.
    fn panels_of<'v>(
        &'v self,
        (range, left): &(Range<usize>, Remainders),
        memory: &'v mut Vec<f64>,
    ) -> &'v [f64] {
        if let Some(values) = &self.panels {
            return values;
        }
        let matrix = Matrix {
            normal: self.normal,
            diagonal: &self.diagonal,
        };
        let fronts = &self.fronts.all[range.clone()];
        memory.resize(values_of(fronts), 0.0);
        let mut panels = &mut memory[..];
        let mut again = FrontElimination::new(&self.fronts, matrix, range.start, left.clone());
        for front in fronts {
            let panel = panels.split_off_mut(..front.values()).unwrap_or_default();
            let eliminated = again.eliminate_next(panel);
            debug_assert!(eliminated.is_ok(), "it was eliminated before");
        }
        memory
    }

    /// Columns of a front, of the `values` of its stretch.
    fn panel<'v>(
        &self,
        front: &Front,
        (range, _): &(Range<usize>, Remainders),
        values: &'v [f64],
    ) -> Panel<'v> {
        let start = front.start - self.fronts.all[range.start].start;
        let panel = &values[start..][..front.values()];
        MatRef::from_column_major_slice(panel, front.height(), front.width())
            .split_at_row(front.width())
    }

    /// Computes `H⁻¹ B` of a matrix B with C columns, given and returned frame by frame.
    pub fn solve<const C: usize>(
        &self,
        blocks: &[SMatrix<f64, FRAME_PARAMETERS, C>],
    ) -> Vec<SMatrix<f64, FRAME_PARAMETERS, C>> {
        let mut solution = blocks.to_vec();
        let fronts = &self.fronts;
        self.for_each_front(|front, (own, below)| {
            let mut x = gather(&solution, fronts.slots(front));
            solve_lower_triangular_in_place(own, x.as_mut(), Par::Seq);
            scatter(&mut solution, fronts.slots(front), x.as_ref());
            let rows = fronts.row_slots(front);
            let mut of_rows = gather(&solution, &rows);
            matmul(
                of_rows.as_mut(),
                Accum::Add,
                below,
                x.as_ref(),
                -1.0,
                Par::Seq,
            );
            scatter(&mut solution, &rows, of_rows.as_ref());
        });
        self.for_each_front_reversed(|front, (own, below)| {
            let of_rows = gather(&solution, &fronts.row_slots(front));
            let mut x = gather(&solution, fronts.slots(front));
            matmul(
                x.as_mut(),
                Accum::Add,
                below.transpose(),
                of_rows.as_ref(),
                -1.0,
                Par::Seq,
            );
            solve_upper_triangular_in_place(own.transpose(), x.as_mut(), Par::Seq);
            scatter(&mut solution, fronts.slots(front), x.as_ref());
        });
        solution
    }

    /// `log det H`.
    pub fn log_determinant(&self) -> f64 {
        self.log_determinant
    }

    /// Solves `H δ = −g` for the step δ.
    pub fn step(&self, gradient: &[FrameStep]) -> Vec<FrameStep> {
        let right: Vec<FrameStep> = gradient.iter().map(|g| -g).collect();
        self.solve(&right)
    }
}

/// Rows of some slots as one matrix.
fn gather<const C: usize>(blocks: &[SMatrix<f64, FRAME_PARAMETERS, C>], slots: &[u32]) -> Mat<f64> {
    let mut rows = Mat::zeros(slots.len() * FRAME_PARAMETERS, C);
    for (k, slot) in slots.iter().enumerate() {
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
fn scatter<const C: usize>(
    blocks: &mut [SMatrix<f64, FRAME_PARAMETERS, C>],
    slots: &[u32],
    rows: MatRef<f64>,
) {
    for (k, slot) in slots.iter().enumerate() {
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
    use crate::linear::selected_inverse::SelectedInverse;
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

    /// A factor of which no front is kept is that of which all are.
    #[test]
    fn columns_are_computed_again_where_they_are_not_kept() {
        let (pattern, normal, _) = random_equations(60, 5, 20.0);
        let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
        let solve = |max_values: usize| {
            let factor = symbolic.factorise_within(max_values, &normal, |_, own| own);
            let factor = factor.unwrap();
            let inverse = SelectedInverse::new(&factor).block(30, 31);
            (
                factor.panels.is_some(),
                (factor.step(&normal.gradient), inverse),
            )
        };
        let (kept, computed_again) = (solve(usize::MAX), solve(0));
        assert!(kept.0 && !computed_again.0);
        assert_eq!(kept.1, computed_again.1);
    }

    /// Prints times of the factor of long tunnels and of a step by it, twelve frames a turn, each
    /// of which overlaps with two on either side and with three of each of the three turns beside.
    #[test]
    #[ignore = "a measurement"]
    fn factor_of_a_long_tunnel() {
        for frames in [10_000, 100_000, 1_000_000] {
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
                normal.gradient[column] = FrameStep::repeat(1.0);
            }
            let start = std::time::Instant::now();
            let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
            let analysed = start.elapsed();
            let factor = symbolic.factorise(&normal, 0.0).unwrap();
            let factored = start.elapsed() - analysed;
            let step = factor.step(&normal.gradient);
            let stepped = start.elapsed() - factored - analysed;
            // Where a frame has all of its neighbours, the rows of the matrix add up to 8.
            assert!((step[frames / 2] + FrameStep::repeat(1.0 / 8.0)).norm() < 1e-6);
            println!(
                "{frames} frames: analysis {analysed:.2?}, factor {factored:.2?}, step \
                 {stepped:.2?}"
            );
        }
    }
}
