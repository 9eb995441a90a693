//! Equations of the exposures alone: for known poses and a known shape.
//!
//! Of each block of two frames they have the gains and biases, two by two. Several frames that
//! follow each other share a slot, so that the matrix and its factor are a fraction of those of all
//! unknowns.

use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::parameters::frame_estimate::{EXPOSURE, FRAME_PARAMETERS, FrameStep, POSE};
use nalgebra::SMatrix;

/// Frames of a slot.
const FRAMES_PER_SLOT: usize = FRAME_PARAMETERS / EXPOSURE;

/// Places of the exposures in equations of their own.
pub struct ExposurePattern {
    frames: usize,
    /// The pattern of the slots.
    pub slots: Pattern,
}

impl ExposurePattern {
    /// The exposures of the first `frames` slots of a pattern.
    pub fn new(pattern: &Pattern, frames: usize) -> Self {
        let slot = |frame: usize| frame / FRAMES_PER_SLOT;
        let pairs = (0..frames).flat_map(|column| {
            let rows = pattern.rows(column).iter();
            rows.map(move |row| (slot(*row), slot(column)))
        });
        Self {
            frames,
            slots: Pattern::new(frames.div_ceil(FRAMES_PER_SLOT), pairs),
        }
    }

    /// The blocks of the exposures of a symmetric matrix with the upper `blocks` on `pattern`.
    pub fn blocks(&self, pattern: &Pattern, blocks: &[Block]) -> Vec<Block> {
        let mut packed = vec![Block::zeros(); self.slots.blocks()];
        for column in 0..self.frames {
            for &row in pattern.rows(column) {
                let (above, own) = (row / FRAMES_PER_SLOT, column / FRAMES_PER_SLOT);
                let places = pattern.block_index(row, column);
                let Some((from, to)) = places.zip(self.slots.block_index(above, own)) else {
                    continue;
                };
                let exposures = blocks[from].fixed_view::<EXPOSURE, EXPOSURE>(POSE, POSE);
                let mut set =
                    |row: usize, column: usize, part: SMatrix<f64, EXPOSURE, EXPOSURE>| {
                        let place = (first_row(row), first_row(column));
                        packed[to]
                            .fixed_view_mut::<EXPOSURE, EXPOSURE>(place.0, place.1)
                            .copy_from(&part);
                    };
                set(row, column, exposures.into_owned());
                if above == own && row != column {
                    set(column, row, exposures.transpose());
                }
            }
        }
        packed
    }

    /// The normal equations of the exposures.
    pub fn equations(&self, pattern: &Pattern, normal: &NormalEquations) -> NormalEquations {
        let mut equations = NormalEquations {
            blocks: self.blocks(pattern, &normal.blocks),
            gradient: vec![FrameStep::zeros(); self.slots.columns()],
        };
        // The last slot may have room for more frames than there are.
        if let Some(last) = self.slots.columns().checked_sub(1) {
            let used = EXPOSURE * (self.frames - last * FRAMES_PER_SLOT);
            let free = FrameStep::from_fn(|k, _| if k < used { 0.0 } else { 1.0 });
            equations.add_block(&self.slots, last, last, &Block::from_diagonal(&free));
        }
        equations
    }

    /// The rows of the exposures of right sides, given frame by frame.
    pub fn rows<const C: usize>(
        &self,
        frames: &[SMatrix<f64, FRAME_PARAMETERS, C>],
    ) -> Vec<SMatrix<f64, FRAME_PARAMETERS, C>> {
        let zeros = SMatrix::<f64, FRAME_PARAMETERS, C>::zeros();
        let mut packed = vec![zeros; self.slots.columns()];
        for (frame, rows) in frames.iter().enumerate().take(self.frames) {
            packed[frame / FRAMES_PER_SLOT]
                .fixed_rows_mut::<EXPOSURE>(first_row(frame))
                .copy_from(&rows.fixed_rows::<EXPOSURE>(POSE));
        }
        packed
    }
}

/// First row of a frame's exposure in its slot.
fn first_row(frame: usize) -> usize {
    EXPOSURE * (frame % FRAMES_PER_SLOT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::sparse_cholesky::SymbolicFactorisation;
    use crate::linear::test_dense::random_equations;

    /// Compared with the dense matrix, of whose unknowns all but the exposures are left out.
    #[test]
    fn exposures_are_solved_for_as_in_the_dense_equations() {
        let frames = 6;
        let (pattern, normal, dense) = random_equations(frames + 1, 2, 20.0);
        let exposures = ExposurePattern::new(&pattern, frames);
        assert_eq!(exposures.slots.columns(), 2);
        let equations = exposures.equations(&pattern, &normal);
        let symbolic = SymbolicFactorisation::new(&exposures.slots).unwrap();
        let factor = symbolic.factorise(&equations, 0.0);
        let right = |frame: usize| {
            let number = |row: usize, _| (1.3 * (row + 8 * frame) as f64).sin();
            SMatrix::<f64, FRAME_PARAMETERS, 1>::from_fn(number)
        };
        let right: Vec<_> = (0..=frames).map(right).collect();
        let solved = factor.unwrap().solve(&exposures.rows(&right));
        let of_exposures: Vec<usize> = (0..frames * FRAME_PARAMETERS)
            .filter(|k| k % FRAME_PARAMETERS >= POSE)
            .collect();
        let alone = dense
            .select_rows(&of_exposures)
            .select_columns(&of_exposures);
        let sides = of_exposures.iter();
        let sides = sides.map(|k| right[k / FRAME_PARAMETERS][k % FRAME_PARAMETERS]);
        let expected = alone
            .lu()
            .solve(&nalgebra::DVector::from_iterator(12, sides));
        for (k, expected) in expected.unwrap().iter().enumerate() {
            let found = solved[k / FRAME_PARAMETERS][k % FRAME_PARAMETERS];
            assert!((found - expected).abs() < 1e-12, "{k}");
        }
    }
}
