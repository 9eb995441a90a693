//! The border of the normal equations: unknowns that all frames share.
//!
//! With poses p and shared unknowns κ ([`crate::refine::parameters::calibration`]) the normal matrix is an arrowhead,
//!
//! `[H_pp  H_pκ; H_κp  H_κκ] (δp, δκ) = −(g_p, g_κ)`,
//!
//! with H_pp sparse as ever. Eliminating the poses by its factor leaves the few equations
//!
//! `S δκ = −(g_κ − Wᵀ g_p)`, `S = H_κκ − H_κp W`, `W = H_pp⁻¹ H_pκ`, and then
//! `δp = −H_pp⁻¹ g_p − W δκ`.
//!
//! With Q the scatter of the whole gradient over the square of its curvature (both of
//! [`crate::refine::uncertainty::covariance`]), `Σ_κ = S⁻¹ (E Q Eᵀ) S⁻¹` with `E = (−Wᵀ, I)` is the covariance of κ with
//! the poses unknown, and `Z + W Σ_κ Wᵀ` that of the poses with κ unknown.
//!
//! What a tile adds ([`crate::refine::problem::intrinsics_terms`]): if κ changes, the pixel of frame i that looks at x shows the
//! wall at `x − C_i δκ` instead, with `C_i = ∂(s, h)/∂κ`, so C_i stands beside A_i (see
//! [`crate::refine::tiles::tile`]). The sums over all other frames of the bracket `w_i δ_ij − w_i w_j / Σw` are
//! those from the mean `C̄ = Σ w C / Σ w`:
//!
//! `H_pκ,i = w̄_i B_iᵀ M (C_i − C̄)`, `H_κκ = Σ_i w̄_i (C_i − C̄)ᵀ M (C_i − C̄)`,
//! `g_κ = −Σ_i C_iᵀ g_i`.

use crate::refine::linear::normal_equations::{Block, Pattern};
use crate::refine::linear::sparse_cholesky::Factor;
use crate::refine::parameters::calibration::{Calibration, Kappa, SHARED};
use crate::refine::parameters::frame_estimate::{FrameStep, UNKNOWNS};
use nalgebra::SMatrix;

/// A frame's unknowns by the shared ones.
pub type BorderBlock = SMatrix<f64, UNKNOWNS, SHARED>;
/// The shared unknowns by themselves.
pub type SharedBlock = SMatrix<f64, SHARED, SHARED>;

/// The border of the normal equations.
#[derive(Clone, Debug)]
pub struct SharedBorder {
    /// `H_pκ`, a block a frame.
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

    /// Multiplies everything.
    pub fn scale(&mut self, factor: f64) {
        self.frames.iter_mut().for_each(|block| *block *= factor);
        self.own *= factor;
        self.gradient *= factor;
    }

    /// Counts a part of the cost with the gradients `frames` (slot by slot) and `shared` into the
    /// scatter.
    pub fn count(&mut self, frames: impl Iterator<Item = (usize, FrameStep)>, shared: &Kappa) {
        for (slot, gradient) in frames {
            self.frames[slot] += gradient * shared.transpose();
        }
        self.own += shared * shared.transpose();
    }

    /// Adds the prior of κ, and takes the unknowns that are not free out of the equations.
    pub fn close(&mut self, calibration: &Calibration, kappa: &Kappa) {
        for k in 0..SHARED {
            if calibration.free[k] {
                let information = calibration.sigma[k].powi(-2);
                self.own[(k, k)] += information;
                self.gradient[k] += information * kappa[k];
            } else {
                for block in &mut self.frames {
                    block.column_mut(k).fill(0.0);
                }
                self.own.row_mut(k).fill(0.0);
                self.own.column_mut(k).fill(0.0);
                self.own[(k, k)] = 1.0;
                self.gradient[k] = 0.0;
            }
        }
    }

    /// Eliminates the poses: W, and S with `λ diag H_κκ` added.
    pub fn eliminate(&self, factor: &Factor, lambda: f64) -> Eliminated {
        let w = factor.solve(&self.frames);
        let mut schur = self.own + SharedBlock::from_diagonal(&(self.own.diagonal() * lambda));
        for (block, w) in self.frames.iter().zip(&w) {
            schur -= block.transpose() * w;
        }
        // Symmetric but for rounding.
        schur = (schur + schur.transpose()) * 0.5;
        Eliminated { w, schur }
    }

    /// The damped step `(δp, δκ)`; None if S is not positive definite.
    pub fn step(
        &self,
        factor: &Factor,
        gradient: &[FrameStep],
        lambda: f64,
    ) -> Option<(Vec<FrameStep>, Kappa)> {
        let Eliminated { w, schur } = self.eliminate(factor, lambda);
        let mut reduced = self.gradient;
        for (w, gradient) in w.iter().zip(gradient) {
            reduced -= w.transpose() * gradient;
        }
        let shared = schur.cholesky()?.solve(&-reduced);
        let mut step = factor.step(gradient);
        for (step, w) in step.iter_mut().zip(&w) {
            *step -= w * shared;
        }
        Some((step, shared))
    }
}

/// `E Q Eᵀ` with `E = (−Wᵀ, I)`: what a matrix of poses (`blocks` on `pattern`) and shared unknowns
/// is to these alone.
pub fn reduce(
    pattern: &Pattern,
    blocks: &[Block],
    border: &SharedBorder,
    w: &[BorderBlock],
) -> SharedBlock {
    let mut reduced = border.own;
    for column in 0..pattern.frames() {
        let crossed = w[column].transpose() * border.frames[column];
        reduced -= crossed + crossed.transpose();
        for &row in pattern.rows(column) {
            let Some(place) = pattern.place(row, column) else {
                continue;
            };
            let block = w[row].transpose() * blocks[place] * w[column];
            reduced += block;
            if row != column {
                reduced += block.transpose();
            }
        }
    }
    reduced
}

/// The equations of κ with the poses eliminated.
#[derive(Clone, Debug)]
pub struct Eliminated {
    /// `W = H_pp⁻¹ H_pκ`, a block a frame.
    pub w: Vec<BorderBlock>,
    /// S.
    pub schur: SharedBlock,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::refine::linear::normal_equations::{Block, NormalEquations, Pattern};
    use crate::refine::linear::sparse_cholesky::Symbolic;
    use nalgebra::{DMatrix, DVector};

    /// Deterministic numbers in −1..1.
    fn number(k: usize, salt: f64) -> f64 {
        (12.9898 * (k as f64 + 1.0) + 78.233 * salt).sin()
    }

    #[test]
    fn the_step_solves_the_bordered_equations() {
        let frames = 6;
        let pattern = Pattern::new(frames, (1..frames).map(|k| (k - 1, k)));
        let mut normal = NormalEquations::zeros(&pattern);
        let mut border = SharedBorder::zeros(frames);
        let n = frames * UNKNOWNS;
        let mut dense = DMatrix::zeros(n + SHARED, n + SHARED);
        let mut gradient = DVector::zeros(n + SHARED);
        for column in 0..frames {
            for &row in pattern.rows(column) {
                let mut block = Block::from_fn(|r, c| number(r + 8 * c, (row + 9 * column) as f64));
                if row == column {
                    block = block * block.transpose() + Block::identity() * 30.0;
                }
                normal.add_block(&pattern, row, column, &block);
                for r in 0..UNKNOWNS {
                    for c in 0..UNKNOWNS {
                        dense[(row * UNKNOWNS + r, column * UNKNOWNS + c)] = block[(r, c)];
                        dense[(column * UNKNOWNS + c, row * UNKNOWNS + r)] = block[(r, c)];
                    }
                }
            }
            normal.gradient[column] = FrameStep::from_fn(|r, _| number(r, column as f64));
            border.frames[column] =
                BorderBlock::from_fn(|r, c| number(r + 8 * c, 0.3 * column as f64));
            for r in 0..UNKNOWNS {
                gradient[column * UNKNOWNS + r] = normal.gradient[column][r];
            }
        }
        border.gradient = Kappa::from_fn(|k, _| number(k, 0.7));
        border.own = SharedBlock::identity() * 40.0;
        // One unknown is held.
        let mut calibration = Calibration::none(&Camera::from_vertical_fov(16, 16, 1.0));
        calibration.free = [true; SHARED];
        calibration.free[4] = false;
        let kappa = Kappa::from_fn(|k, _| 0.1 * number(k, 0.2));
        border.close(&calibration, &kappa);
        for column in 0..frames {
            for r in 0..UNKNOWNS {
                for c in 0..SHARED {
                    dense[(column * UNKNOWNS + r, n + c)] = border.frames[column][(r, c)];
                    dense[(n + c, column * UNKNOWNS + r)] = border.frames[column][(r, c)];
                }
            }
        }
        for r in 0..SHARED {
            gradient[n + r] = border.gradient[r];
            for c in 0..SHARED {
                dense[(n + r, n + c)] = border.own[(r, c)];
            }
        }
        let symbolic = Symbolic::new(&pattern).unwrap();
        for lambda in [0.0, 0.1] {
            let factor = symbolic.factorise(&pattern, &normal, lambda).unwrap();
            let (step, shared) = border.step(&factor, &normal.gradient, lambda).unwrap();
            let damped = &dense + DMatrix::from_diagonal(&(dense.diagonal() * lambda));
            let expected = damped.lu().solve(&-&gradient).unwrap();
            for k in 0..n {
                assert!((step[k / UNKNOWNS][k % UNKNOWNS] - expected[k]).abs() < 1e-10);
            }
            for k in 0..SHARED {
                assert!((shared[k] - expected[n + k]).abs() < 1e-10);
            }
            assert_eq!(shared[4], 0.0);
        }
        // S⁻¹ is the shared part of the whole inverse, and S what the matrix itself is reduced to.
        let factor = symbolic.factorise(&pattern, &normal, 0.0).unwrap();
        let Eliminated { w, schur } = border.eliminate(&factor, 0.0);
        let upper = |k: usize| {
            let mut block = normal.blocks[k];
            block.fill_lower_triangle_with_upper_triangle();
            block
        };
        let blocks: Vec<Block> = (0..pattern.blocks())
            .map(|k| {
                if (0..frames).any(|f| pattern.place(f, f) == Some(k)) {
                    upper(k)
                } else {
                    normal.blocks[k]
                }
            })
            .collect();
        assert!((reduce(&pattern, &blocks, &border, &w) - schur).norm() < 1e-10);
        let inverse = schur.try_inverse().unwrap();
        let whole = dense.try_inverse().unwrap();
        for r in 0..SHARED {
            for c in 0..SHARED {
                assert!((inverse[(r, c)] - whole[(n + r, n + c)]).abs() < 1e-12);
            }
        }
    }
}
