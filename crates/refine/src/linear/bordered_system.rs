//! Bordered normal equations: frames plus the parameters that all frames share.
//!
//! With the frames' parameters p and the shared parameters κ
//! ([`crate::parameters::calibration`]) the normal matrix is an arrowhead,
//!
//! `[H_pp  H_pκ; H_κp  H_κκ] (δp, δκ) = −(g_p, g_κ)`,
//!
//! with the sparse `H_pp` of [`crate::linear::normal_equations`]. Its factor eliminates the
//! frames, which leaves the Schur complement S:
//!
//! `S δκ = −(g_κ − Wᵀ g_p)`, `S = H_κκ − H_κp W`, `W = H_pp⁻¹ H_pκ`, and then
//! `δp = −H_pp⁻¹ g_p − W δκ`.
//!
//! With Q the scatter of the whole gradient over the square of its curvature (both of
//! [`crate::uncertainty::covariance`]), `Σ_κ = S⁻¹ (E Q Eᵀ) S⁻¹`, `E = (−Wᵀ, I)`, is the
//! marginal covariance of κ. With `Z = H_pp⁻¹`, the marginal covariance of the frames is
//! `Z + W Σ_κ Wᵀ`.
//!
//! [`crate::problem::intrinsics_terms`] derives the contribution of a tile to the border.

use crate::linear::normal_equations::{Block, Pattern};
use crate::linear::sparse_cholesky::Factor;
use crate::parameters::calibration::{Calibration, Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use nalgebra::SMatrix;

/// A frame's parameters by the shared ones.
pub type BorderBlock = SMatrix<f64, FRAME_PARAMETERS, SHARED_PARAMETERS>;
/// The shared parameters by themselves.
pub type SharedBlock = SMatrix<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>;

/// The rows of the normal equations that belong to the shared parameters.
#[derive(Clone, Debug)]
pub struct SharedBorder {
    /// `H_pκ`, one block per frame.
    pub frames: Vec<BorderBlock>,
    /// `H_κκ`.
    pub own: SharedBlock,
    /// `g_κ`.
    pub gradient: Kappa,
}

impl SharedBorder {
    /// All zero.
    pub fn zeros(frames: usize) -> Self {
        Self {
            frames: vec![BorderBlock::zeros(); frames],
            own: SharedBlock::zeros(),
            gradient: Kappa::zeros(),
        }
    }

    /// Multiplies all entries.
    pub fn scale(&mut self, factor: f64) {
        self.frames.iter_mut().for_each(|block| *block *= factor);
        self.own *= factor;
        self.gradient *= factor;
    }

    /// Adds the outer product of a partial gradient to the scatter: `frames` (slot by slot) and
    /// `shared` are its parts.
    pub fn add_scatter(
        &mut self,
        frames: impl Iterator<Item = (usize, FrameStep)>,
        shared: &Kappa,
    ) {
        for (slot, gradient) in frames {
            self.frames[slot] += gradient * shared.transpose();
        }
        self.own += shared * shared.transpose();
    }

    /// Adds the prior of κ and removes the parameters that are not free from the equations.
    pub fn apply_prior(&mut self, calibration: &Calibration, kappa: &Kappa) {
        for k in 0..SHARED_PARAMETERS {
            if calibration.has_equations(k) {
                let information = calibration.sigma[k].powi(-2);
                self.own[(k, k)] += information;
                self.gradient[k] += information * kappa[k];
            } else {
                self.remove(k);
            }
        }
    }

    /// Removes a parameter from the equations: its step is zero.
    pub fn remove(&mut self, k: usize) {
        for block in &mut self.frames {
            block.column_mut(k).fill(0.0);
        }
        self.own.row_mut(k).fill(0.0);
        self.own.column_mut(k).fill(0.0);
        self.own[(k, k)] = 1.0;
        self.gradient[k] = 0.0;
    }

    /// Eliminates the frames: W, and S with `λ diag H_κκ` added.
    pub fn eliminate(&self, factor: &Factor, lambda: f64) -> SchurComplement {
        let w = factor.solve(&self.frames);
        let mut schur = self.own + SharedBlock::from_diagonal(&(self.own.diagonal() * lambda));
        for (block, w) in self.frames.iter().zip(&w) {
            schur -= block.transpose() * w;
        }
        // Rounding makes it slightly unsymmetric.
        schur = (schur + schur.transpose()) * 0.5;
        SchurComplement { w, schur }
    }

    /// The damped step `(δp, δκ)` with the parameters `held` fixed; None if S is not positive
    /// definite.
    pub fn step(
        &self,
        factor: &Factor,
        gradient: &[FrameStep],
        (lambda, held): (f64, &[bool; SHARED_PARAMETERS]),
    ) -> Option<(Vec<FrameStep>, Kappa)> {
        let schur = self.eliminate(factor, lambda);
        let step = schur.step(factor, gradient, &self.gradient)?;
        schur.step_holding(step, &held.map(|held| held.then_some(0.0)))
    }
}

/// Projects a matrix Q of frames (`blocks` on `pattern`) and shared parameters (`border`) to the
/// shared ones: `E Q Eᵀ`, `E = (−Wᵀ, I)`.
pub fn reduce_to_shared(
    pattern: &Pattern,
    blocks: &[Block],
    border: &SharedBorder,
    w: &[BorderBlock],
) -> SharedBlock {
    let mut reduced = border.own;
    for column in 0..pattern.columns() {
        let cross = w[column].transpose() * border.frames[column];
        reduced -= cross + cross.transpose();
        for &row in pattern.rows(column) {
            let Some(index) = pattern.block_index(row, column) else {
                continue;
            };
            let block = w[row].transpose() * blocks[index] * w[column];
            reduced += block;
            if row != column {
                reduced += block.transpose();
            }
        }
    }
    reduced
}

/// The equations of κ with the frames eliminated.
#[derive(Clone, Debug)]
pub struct SchurComplement {
    /// `W = H_pp⁻¹ H_pκ`, one block per frame.
    pub w: Vec<BorderBlock>,
    /// S.
    pub schur: SharedBlock,
}

impl SchurComplement {
    /// The step `(δp, δκ)` for the gradients of the slots and of the shared parameters; None if S
    /// is not positive definite.
    pub fn step(
        &self,
        factor: &Factor,
        gradient: &[FrameStep],
        shared_gradient: &Kappa,
    ) -> Option<(Vec<FrameStep>, Kappa)> {
        let mut reduced = *shared_gradient;
        for (w, gradient) in self.w.iter().zip(gradient) {
            reduced -= w.transpose() * gradient;
        }
        let shared = self.schur.cholesky()?.solve(&-reduced);
        let mut step = factor.step(gradient);
        for (step, w) in step.iter_mut().zip(&self.w) {
            *step -= w * shared;
        }
        Some((step, shared))
    }

    /// From the step to the minimum, that to the minimum where the shared parameters make the steps
    /// `held`, as far as it has values; None if S is not positive definite.
    ///
    /// With F the held parameters and R the others, `δκ_R` changes by `−S_RR⁻¹ S_RF` times the
    /// change of `δκ_F`, and slots by −W times that of `δκ`.
    pub fn step_holding(
        &self,
        (mut step, shared): (Vec<FrameStep>, Kappa),
        held: &[Option<f64>; SHARED_PARAMETERS],
    ) -> Option<(Vec<FrameStep>, Kappa)> {
        if held.iter().all(Option::is_none) {
            return Some((step, shared));
        }
        let forced = Kappa::from_fn(|k, _| held[k].map_or(0.0, |to| to - shared[k]));
        let (mut reduced, mut right) = (self.schur, -(self.schur * forced));
        for k in (0..SHARED_PARAMETERS).filter(|k| held[*k].is_some()) {
            reduced.row_mut(k).fill(0.0);
            reduced.column_mut(k).fill(0.0);
            reduced[(k, k)] = 1.0;
            right[k] = forced[k];
        }
        let change = reduced.cholesky()?.solve(&right);
        for (step, w) in step.iter_mut().zip(&self.w) {
            *step -= w * change;
        }
        Some((step, shared + change))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
    use crate::linear::sparse_cholesky::SymbolicFactorisation;
    use crate::linear::test_dense::set_block;
    use nalgebra::{DMatrix, DVector};
    use tunnelstitch_geometry::camera::Camera;

    /// Deterministic numbers in −1..1.
    fn number(k: usize, salt: f64) -> f64 {
        (12.9898 * (k as f64 + 1.0) + 78.233 * salt).sin()
    }

    #[test]
    fn step_solves_the_bordered_equations() {
        let frames = 6;
        let pattern = Pattern::new(frames, (1..frames).map(|k| (k - 1, k)));
        let mut normal = NormalEquations::zeros(&pattern);
        let mut border = SharedBorder::zeros(frames);
        let n = frames * FRAME_PARAMETERS;
        let mut dense = DMatrix::zeros(n + SHARED_PARAMETERS, n + SHARED_PARAMETERS);
        let mut gradient = DVector::zeros(n + SHARED_PARAMETERS);
        for column in 0..frames {
            for &row in pattern.rows(column) {
                let mut block = Block::from_fn(|r, c| number(r + 8 * c, (row + 9 * column) as f64));
                if row == column {
                    block = block * block.transpose() + Block::identity() * 30.0;
                }
                normal.add_block(&pattern, row, column, &block);
                set_block(&mut dense, row, column, &block);
            }
            normal.gradient[column] = FrameStep::from_fn(|r, _| number(r, column as f64));
            border.frames[column] =
                BorderBlock::from_fn(|r, c| number(r + 8 * c, 0.3 * column as f64));
            for r in 0..FRAME_PARAMETERS {
                gradient[column * FRAME_PARAMETERS + r] = normal.gradient[column][r];
            }
        }
        border.gradient = Kappa::from_fn(|k, _| number(k, 0.7));
        border.own = SharedBlock::identity() * 40.0;
        // One parameter is not free.
        let mut calibration = Calibration::none(Camera::from_vertical_fov(16, 16, 1.0));
        calibration.free = [true; SHARED_PARAMETERS];
        calibration.free[4] = false;
        let kappa = Kappa::from_fn(|k, _| 0.1 * number(k, 0.2));
        border.apply_prior(&calibration, &kappa);
        for column in 0..frames {
            for r in 0..FRAME_PARAMETERS {
                for c in 0..SHARED_PARAMETERS {
                    dense[(column * FRAME_PARAMETERS + r, n + c)] = border.frames[column][(r, c)];
                    dense[(n + c, column * FRAME_PARAMETERS + r)] = border.frames[column][(r, c)];
                }
            }
        }
        for r in 0..SHARED_PARAMETERS {
            gradient[n + r] = border.gradient[r];
            for c in 0..SHARED_PARAMETERS {
                dense[(n + r, n + c)] = border.own[(r, c)];
            }
        }
        let symbolic = SymbolicFactorisation::new(&pattern).unwrap();
        for lambda in [0.0, 0.1] {
            let factor = symbolic.factorise(&normal, lambda).unwrap();
            let (step, shared) = border
                .step(
                    &factor,
                    &normal.gradient,
                    (lambda, &[false; SHARED_PARAMETERS]),
                )
                .unwrap();
            let damped = &dense + DMatrix::from_diagonal(&(dense.diagonal() * lambda));
            let expected = damped.lu().solve(&-&gradient).unwrap();
            for k in 0..n {
                assert!(
                    (step[k / FRAME_PARAMETERS][k % FRAME_PARAMETERS] - expected[k]).abs() < 1e-10
                );
            }
            for k in 0..SHARED_PARAMETERS {
                assert!((shared[k] - expected[n + k]).abs() < 1e-10);
            }
            assert_eq!(shared[4], 0.0);
        }
        // S⁻¹ is the shared block of the whole inverse, and H itself reduces to S.
        let factor = symbolic.factorise(&normal, 0.0).unwrap();
        let SchurComplement { w, schur } = border.eliminate(&factor, 0.0);
        let mirrored = |k: usize| {
            let mut block = normal.blocks[k];
            block.fill_lower_triangle_with_upper_triangle();
            block
        };
        let blocks: Vec<Block> = (0..pattern.blocks())
            .map(|k| {
                if (0..frames).any(|f| pattern.block_index(f, f) == Some(k)) {
                    mirrored(k)
                } else {
                    normal.blocks[k]
                }
            })
            .collect();
        assert!((reduce_to_shared(&pattern, &blocks, &border, &w) - schur).norm() < 1e-10);
        let inverse = schur.try_inverse().unwrap();
        let whole = dense.try_inverse().unwrap();
        for r in 0..SHARED_PARAMETERS {
            for c in 0..SHARED_PARAMETERS {
                assert!((inverse[(r, c)] - whole[(n + r, n + c)]).abs() < 1e-12);
            }
        }
    }
}
