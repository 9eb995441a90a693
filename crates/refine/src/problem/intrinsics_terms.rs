//! Contribution of a block of the wall to the border of the normal equations.
//!
//! If the shared parameters κ change by δκ, the pixel of frame i that observes x shows the wall at
//! `x − C_i δκ`, with `C_i = ∂(s, h)/∂κ`
//! ([`crate::tiles::frame_samples::SampledFrame::shared_jacobian`]): C_i stands beside the
//! pose's A_i ([`crate::tiles::tile`]). The sums over the bracket
//! `w̄_i δ_ij − w̄_i w̄_j / Σw̄` become differences from the mean `C̄ = Σ w̄ C / Σ w̄`:
//!
//! `H_pκ,i = w̄_i B_iᵀ M (C_i − C̄)`, `H_κκ = Σ_i w̄_i (C_i − C̄)ᵀ M (C_i − C̄)`,
//! `g_κ = −Σ_i C_iᵀ g_i`.
//!
//! [`crate::linear::bordered_system`] solves the bordered equations.

use crate::linear::bordered_system::SharedBorder;
use crate::parameters::calibration::{Kappa, PIXEL_INDICES, PIXEL_PARAMETERS};
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use crate::problem::observer_column::ObserverColumn;
use crate::tiles::frame_samples::SharedJacobian;
use nalgebra::{Matrix4, Matrix4x2, RowSVector, SMatrix, SVector};

/// A matrix over the shared parameters that pixels depend on.
type SharedSquare = SMatrix<f64, PIXEL_PARAMETERS, PIXEL_PARAMETERS>;

/// Sums over the tiles of one block for the shared parameters that pixels depend on, for the few
/// frames that observe it.
#[derive(Clone, Debug)]
pub struct IntrinsicsSums {
    /// `H_pκ` and `H_cκ`, one block per slot.
    frames: Vec<SMatrix<f64, FRAME_PARAMETERS, PIXEL_PARAMETERS>>,
    /// `H_κκ`.
    own: SharedSquare,
    /// `g_κ`.
    gradient: SVector<f64, PIXEL_PARAMETERS>,
}

impl IntrinsicsSums {
    /// All zero.
    pub fn new(slots: usize) -> Self {
        Self {
            frames: vec![SMatrix::zeros(); slots],
            own: SharedSquare::zeros(),
            gradient: SVector::zeros(),
        }
    }

    /// Adds a tile. `columns`: all its observers; `features`: M; `total_weight`: `Σ w̄`.
    pub fn add_tile(
        &mut self,
        columns: &[ObserverColumn],
        features: &Matrix4<f64>,
        total_weight: f64,
    ) {
        let weighted = columns.iter().map(|i| i.c * i.moments.weight);
        let mean = weighted.sum::<SharedJacobian>() / total_weight.max(1e-12);
        // C affects the slopes along s and h only.
        let slopes: Matrix4x2<f64> = features.fixed_columns::<2>(0).into_owned();
        for i in columns {
            let deviation = i.c - mean;
            let f = slopes * deviation * i.moments.weight;
            let block = &mut self.frames[i.frame];
            for column in 0..PIXEL_PARAMETERS {
                for row in 0..6 {
                    block[(row, column)] +=
                        i.a[(0, row)] * f[(0, column)] + i.a[(1, row)] * f[(1, column)];
                }
                block[(6, column)] += f[(2, column)];
                block[(7, column)] += f[(3, column)] * i.inverse_gain;
            }
            self.own += deviation.transpose() * f.fixed_rows::<2>(0);
            self.gradient -= i.c.transpose() * i.moments.gradient.fixed_rows::<2>(0);
        }
    }

    /// Adds to the row of a coefficient of the wall's shape: component of the block with the given
    /// index ([`crate::problem::shape_terms`]).
    pub fn add_shape(
        &mut self,
        index: usize,
        component: usize,
        row: &RowSVector<f64, PIXEL_PARAMETERS>,
    ) {
        let mut target = self.frames[index].row_mut(component);
        target += row;
    }

    /// `g_κ`, with zeros for the parameters that pixels do not depend on.
    pub fn shared_gradient(&self) -> Kappa {
        let mut shared = Kappa::zeros();
        for (column, index) in PIXEL_INDICES.into_iter().enumerate() {
            shared[index] = self.gradient[column];
        }
        shared
    }

    /// Adds `factor` times the block, whose slots are `slots`, to the border.
    pub fn add_to(&self, slots: &[usize], factor: f64, border: &mut SharedBorder) {
        for (slot, block) in slots.iter().zip(&self.frames) {
            for (column, index) in PIXEL_INDICES.into_iter().enumerate() {
                let mut target = border.frames[*slot].column_mut(index);
                target += block.column(column) * factor;
            }
        }
        for (column, index) in PIXEL_INDICES.into_iter().enumerate() {
            for (row, other) in PIXEL_INDICES.into_iter().enumerate() {
                border.own[(other, index)] += self.own[(row, column)] * factor;
            }
        }
        border.gradient += self.shared_gradient() * factor;
    }
}
