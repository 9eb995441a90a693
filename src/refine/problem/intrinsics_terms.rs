//! What a block of the wall adds to the border of the normal equations ([`crate::refine::linear::bordered_system`]).

use crate::refine::linear::bordered_system::SharedBorder;
use crate::refine::parameters::calibration::{INTRINSIC_PARAMETERS, Kappa, READOUT_INDEX};
use crate::refine::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use crate::refine::problem::observer_column::Column;
use nalgebra::{Matrix2x6, Matrix4, Matrix4x2, Matrix6, SMatrix, Vector6};

/// Shared unknowns that pixels see: those of the lens and the readout time.
const SEEN: usize = INTRINSIC_PARAMETERS + 1;
/// Their places among all.
const PLACES: [usize; SEEN] = [0, 1, 2, 3, 4, READOUT_INDEX];

/// Sums over the tiles of one block for the unknowns that pixels see, for the few frames that see
/// it.
#[derive(Clone, Debug)]
pub struct IntrinsicsSums {
    /// `H_pκ`, a block a frame.
    frames: Vec<SMatrix<f64, FRAME_PARAMETERS, SEEN>>,
    /// `H_κκ`.
    own: Matrix6<f64>,
    /// `g_κ`.
    gradient: Vector6<f64>,
}

impl IntrinsicsSums {
    /// All zero.
    pub fn new(frames: usize) -> Self {
        Self {
            frames: vec![SMatrix::zeros(); frames],
            own: Matrix6::zeros(),
            gradient: Vector6::zeros(),
        }
    }

    /// Adds a tile: `H_pκ,i = w̄_i B_iᵀ M (C_i − C̄)`, `H_κκ = Σ_i w̄_i (C_i − C̄)ᵀ M (C_i − C̄)`,
    /// `g_κ = −Σ_i C_iᵀ g_i`.
    ///
    /// `columns` are all its observers, `features`: M, `total`: their weight.
    pub fn add_tile(&mut self, columns: &[Column], features: &Matrix4<f64>, total: f64) {
        let weighted = columns.iter().map(|i| i.c * i.moments.weight);
        let mean = weighted.sum::<Matrix2x6<f64>>() / total.max(1e-12);
        // C moves the wall along s and h only.
        let slopes: Matrix4x2<f64> = features.fixed_columns::<2>(0).into_owned();
        for i in columns {
            let apart = i.c - mean;
            let f = slopes * apart * i.moments.weight;
            let block = &mut self.frames[i.place];
            for column in 0..SEEN {
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

    /// Adds the block to the border, and its gradients (those of its frames `slots`, too) to the
    /// border's scatter.
    pub fn add_to(
        &self,
        slots: &[usize],
        gradient: &[FrameStep],
        border: &mut SharedBorder,
        scatter: &mut SharedBorder,
    ) {
        for (slot, block) in slots.iter().zip(&self.frames) {
            for (column, place) in PLACES.into_iter().enumerate() {
                let mut target = border.frames[*slot].column_mut(place);
                target += block.column(column);
            }
        }
        let mut shared = Kappa::zeros();
        for (column, place) in PLACES.into_iter().enumerate() {
            shared[place] = self.gradient[column];
            for (row, other) in PLACES.into_iter().enumerate() {
                border.own[(other, place)] += self.own[(row, column)];
            }
        }
        border.gradient += shared;
        let frames = slots.iter().copied().zip(gradient.iter().copied());
        scatter.count(frames, &shared);
    }
}
