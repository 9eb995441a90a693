//! What a block of the wall adds to the border of the normal equations ([`super::shared`]).

use super::calibration::{Kappa, LENS};
use super::estimate::{FrameStep, UNKNOWNS};
use super::problem::Column;
use super::shared::Border;
use nalgebra::{Matrix2x5, Matrix4, Matrix4x2, Matrix5, SMatrix, Vector5};

/// Sums over the tiles of one block for the unknowns of the lens, for the few frames that see it.
#[derive(Clone, Debug)]
pub struct LensSums {
    /// `H_pκ`, a block a frame.
    frames: Vec<SMatrix<f64, UNKNOWNS, LENS>>,
    /// `H_κκ`.
    own: Matrix5<f64>,
    /// `g_κ`.
    gradient: Vector5<f64>,
}

impl LensSums {
    /// All zero.
    pub fn new(frames: usize) -> Self {
        Self {
            frames: vec![SMatrix::zeros(); frames],
            own: Matrix5::zeros(),
            gradient: Vector5::zeros(),
        }
    }

    /// Adds a tile: `H_pκ,i = w̄_i B_iᵀ M (C_i − C̄)`, `H_κκ = Σ_i w̄_i (C_i − C̄)ᵀ M (C_i − C̄)`, `g_κ = −Σ_i C_iᵀ g_i`.
    ///
    /// `columns` are all its observers, `features`: M, `total`: their weight.
    pub fn add_tile(&mut self, columns: &[Column], features: &Matrix4<f64>, total: f64) {
        let weighted = columns.iter().map(|i| i.c * i.moments.weight);
        let mean = weighted.sum::<Matrix2x5<f64>>() / total.max(1e-12);
        // C moves the wall along s and h only.
        let slopes: Matrix4x2<f64> = features.fixed_columns::<2>(0).into_owned();
        for i in columns {
            let apart = i.c - mean;
            let f = slopes * apart * i.moments.weight;
            let block = &mut self.frames[i.place];
            for column in 0..LENS {
                for row in 0..6 {
                    block[(row, column)] +=
                        i.a[(0, row)] * f[(0, column)] + i.a[(1, row)] * f[(1, column)];
                }
                block[(6, column)] += f[(2, column)];
                block[(7, column)] += f[(3, column)] * i.inverse_gain;
            }
            self.own += apart.transpose() * f.fixed_rows::<2>(0);
            self.gradient -= i.c.transpose() * i.moments.gradient.fixed_rows::<2>(0);
        }
    }

    /// Adds the block to the border, and its gradients (those of its frames `slots`, too) to the border's scatter.
    pub fn add_to(
        &self,
        slots: &[usize],
        gradient: &[FrameStep],
        border: &mut Border,
        scatter: &mut Border,
    ) {
        for (slot, block) in slots.iter().zip(&self.frames) {
            let mut target = border.frames[*slot].fixed_view_mut::<UNKNOWNS, LENS>(0, 0);
            target += block;
        }
        let mut own = border.own.fixed_view_mut::<LENS, LENS>(0, 0);
        own += self.own;
        let mut target = border.gradient.fixed_rows_mut::<LENS>(0);
        target += self.gradient;
        let mut shared = Kappa::zeros();
        shared.fixed_rows_mut::<LENS>(0).copy_from(&self.gradient);
        let frames = slots.iter().copied().zip(gradient.iter().copied());
        scatter.count(frames, &shared);
    }
}
