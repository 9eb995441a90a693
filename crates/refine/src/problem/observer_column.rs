//! Columns of the normal equations of one observer of a tile.

use crate::linear::normal_equations::Block;
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use crate::tiles::frame_samples::SharedJacobian;
use crate::tiles::tile_moments::ObserverMoments;
use nalgebra::{Matrix2x6, Matrix4, SMatrix};

/// Jacobians and moments of an active observer of a tile.
pub struct ObserverColumn {
    /// Index of the frame among those of the block.
    pub frame: usize,
    /// Moments.
    pub moments: ObserverMoments,
    /// `A = ∂(s, h)/∂ξ`.
    pub a: Matrix2x6<f64>,
    /// `C = ∂(s, h)/∂κ`; zero unless shared parameters are estimated.
    pub c: SharedJacobian,
    /// `1/a`, shading included.
    pub inverse_gain: f64,
}

impl ObserverColumn {
    /// Computes `M B` (4 × 8) with the observer's `B = diag(A, 1, 1/a)`.
    #[inline(always)]
    pub fn features_times_b(&self, m: &Matrix4<f64>) -> SMatrix<f64, 4, FRAME_PARAMETERS> {
        let mut product = SMatrix::<f64, 4, FRAME_PARAMETERS>::zeros();
        for c in 0..6 {
            for r in 0..4 {
                product[(r, c)] = m[(r, 0)] * self.a[(0, c)] + m[(r, 1)] * self.a[(1, c)];
            }
        }
        for r in 0..4 {
            product[(r, 6)] = m[(r, 2)];
            product[(r, 7)] = m[(r, 3)] * self.inverse_gain;
        }
        product
    }

    /// Adds `scale · Bᵀ F` to a block.
    #[inline(always)]
    pub fn add_b_transposed_times(
        &self,
        f: &SMatrix<f64, 4, FRAME_PARAMETERS>,
        scale: f64,
        block: &mut Block,
    ) {
        for c in 0..FRAME_PARAMETERS {
            let (f0, f1) = (scale * f[(0, c)], scale * f[(1, c)]);
            for r in 0..6 {
                block[(r, c)] += self.a[(0, r)] * f0 + self.a[(1, r)] * f1;
            }
            block[(6, c)] += scale * f[(2, c)];
            block[(7, c)] += scale * f[(3, c)] * self.inverse_gain;
        }
    }
}
