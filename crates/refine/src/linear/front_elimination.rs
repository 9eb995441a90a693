//! Elimination of fronts, one after the other.

use crate::linear::factor_error::FactorError;
use crate::linear::fronts::{Front, Fronts};
use crate::linear::normal_equations::NormalEquations;
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, Par};

/// The matrix to be factorised: H with another diagonal.
#[derive(Clone, Copy)]
pub struct Matrix<'n> {
    /// Blocks of H.
    pub normal: &'n NormalEquations,
    /// Diagonal of every slot.
    pub diagonal: &'n [FrameStep],
}

/// Matrices that fronts leave of their rows, until their parents take them: those of the front that
/// is next are the last. Each has its front and a lower triangle, column by column.
pub type Remainders = Vec<(u32, Vec<f64>)>;

/// Eliminates fronts in their order.
pub struct FrontElimination<'n> {
    fronts: &'n Fronts,
    matrix: Matrix<'n>,
    next: usize,
    left: Remainders,
    /// Memory of remainders that were taken.
    spare: Vec<Vec<f64>>,
}

impl<'n> FrontElimination<'n> {
    /// Goes on with front `next`; `left`: what those before it have left.
    pub fn new(fronts: &'n Fronts, matrix: Matrix<'n>, next: usize, left: Remainders) -> Self {
        Self {
            fronts,
            matrix,
            next,
            left,
            spare: Vec::new(),
        }
    }

    /// Matrices that the fronts before the next one have left.
    pub fn left(&self) -> &Remainders {
        &self.left
    }

    /// Eliminates the columns of the next front: `panel`, of as many values, is overwritten by
    /// those of L, column by column. What is above the diagonal has no meaning.
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`].
    pub fn eliminate_next(&mut self, panel: &mut [f64]) -> Result<(), FactorError> {
        let fronts = self.fronts;
        let front = &fronts.all[self.next];
        panel.fill(0.0);
        let mut panel = MatMut::from_column_major_slice_mut(panel, front.height(), front.width());
        self.add_equations(front, panel.rb_mut());
        let below = front.below();
        let mut remainder = self.spare.pop().unwrap_or_default();
        remainder.clear();
        remainder.resize(below * below, 0.0);
        let mut update = MatMut::from_column_major_slice_mut(&mut remainder, below, below);
        let is_child = |(child, _): &mut (u32, Vec<f64>)| {
            fronts.all[*child as usize].parent == Some(self.next as u32)
        };
        while let Some((child, of_child)) = self.left.pop_if(is_child) {
            let child = &fronts.all[child as usize];
            add_remainder(front, child, &of_child, panel.rb_mut(), update.rb_mut());
            self.spare.push(of_child);
        }
        eliminate(front, panel, update)?;
        if front.parent.is_some() {
            self.left.push((self.next as u32, remainder));
        }
        self.next += 1;
        Ok(())
    }

    /// Adds the blocks of the matrix in the columns of a front, on and below the diagonal.
    fn add_equations(&self, front: &Front, mut panel: MatMut<f64>) {
        for place in &self.fronts.blocks[front.blocks.clone()] {
            let block = &self.matrix.normal.blocks[place.block as usize];
            let (row, column) = (usize::from(place.row), usize::from(place.column));
            let first = (row * FRAME_PARAMETERS, column * FRAME_PARAMETERS);
            for c in 0..FRAME_PARAMETERS {
                for r in 0..FRAME_PARAMETERS {
                    let value = if place.is_transposed {
                        block[(c, r)]
                    } else {
                        block[(r, c)]
                    };
                    panel[(first.0 + r, first.1 + c)] = value;
                }
            }
            if row == column {
                let slot = self.fronts.slots(front)[column] as usize;
                for k in 0..FRAME_PARAMETERS {
                    panel[(first.0 + k, first.1 + k)] = self.matrix.diagonal[slot][k];
                }
            }
        }
    }
}

/// Adds what a child leaves of its rows to columns (`panel`) and rows (`update`) of its parent.
fn add_remainder(
    front: &Front,
    child: &Front,
    of_child: &[f64],
    mut panel: MatMut<f64>,
    mut update: MatMut<f64>,
) {
    let places = child.places_in(front);
    let width = front.width();
    let columns = of_child.chunks_exact(child.below().max(1));
    for (k, from) in columns.enumerate() {
        let slot = k / FRAME_PARAMETERS;
        let column = places[slot] + k % FRAME_PARAMETERS;
        let (above, to) = if column < width {
            (0, panel.rb_mut().col_mut(column))
        } else {
            (width, update.rb_mut().col_mut(column - width))
        };
        let Some(to) = to.try_as_col_major_mut() else {
            continue;
        };
        let to = to.as_slice_mut();
        let from = from.chunks_exact(FRAME_PARAMETERS).skip(slot);
        for (from, place) in from.zip(&places[slot..]) {
            let to = &mut to[place - above..][..FRAME_PARAMETERS];
            to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        }
    }
}

/// Eliminates the columns of a front: its `panel` becomes that of L, and what they leave of the
/// rows is added to `update`.
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
