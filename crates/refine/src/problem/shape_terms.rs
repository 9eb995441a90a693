//! Contribution of a tile to the normal equations of the wall's shape.
//!
//! If the wall moves outwards by δ along its normal n, the pixel of frame i that observes x shows
//! the wall at `x − τ_i δ`: for the ray, the wall moves as if the camera moved by −δ n, so
//! `τ_i = −A_i (0, n)`, A_i the Jacobian of the pose ([`crate::tiles::tile`]). On a plane it is
//! `(d·e_s, d·e_h)/(d·n)`, d the ray.
//!
//! With `δ = Σ_j c_j φ_j` ([`crate::parameters::shape`]) and the functions taken at the tile's
//! centre, the bracket `w̄_i δ_ij − w̄_i w̄_j/Σw̄` leaves the difference from the mean
//! `τ̄ = Σ w̄ τ/Σ w̄`:
//!
//! `H_pc,i = w̄_i B_iᵀ M (τ_i − τ̄) φᵀ`,  `H_cc = (Σ_i w̄_i (τ_i − τ̄)ᵀ M (τ_i − τ̄)) φ φᵀ`,
//! `H_cκ = φ Σ_i w̄_i (τ_i − τ̄)ᵀ M C_i`,  `g_c = −φ Σ_i τ_iᵀ g_i`.
//!
//! Frames that see the wall along parallel rays (those of one turn) have equal τ and say nothing of
//! the shape.

use crate::parameters::calibration::PIXEL_PARAMETERS;
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use crate::parameters::shape::FunctionValue;
use crate::problem::block_sums::{BlockSums, TileSums};
use crate::problem::observer_column::ObserverColumn;
use nalgebra::{RowSVector, SMatrix, Vector2, Vector3, Vector4};

/// The shape's functions at a tile.
#[derive(Clone, Debug)]
pub struct TileShape {
    /// Unit normal of the nominal wall at the tile's centre.
    pub normal: Vector3<f64>,
    /// The functions that are not zero there, by ascending block.
    pub functions: Vec<FunctionValue>,
}

/// Sums over the observers of a tile.
struct ObserverSums {
    /// `w̄ B_iᵀ M (τ_i − τ̄)` of each observer.
    frames: Vec<SMatrix<f64, FRAME_PARAMETERS, 1>>,
    /// `Σ_i w̄_i (τ_i − τ̄)ᵀ M (τ_i − τ̄)`.
    own: f64,
    /// `Σ_i w̄_i (τ_i − τ̄)ᵀ M C_i`.
    shared: RowSVector<f64, PIXEL_PARAMETERS>,
    /// `−Σ_i τ_iᵀ g_i`.
    gradient: f64,
}

/// Sums over the observers of a tile.
fn sum_observers(tile: &TileSums, normal: &Vector3<f64>) -> ObserverSums {
    let TileSums {
        columns,
        features,
        total_weight,
    } = tile;
    let tau =
        |column: &ObserverColumn| -> Vector2<f64> { -(column.a.fixed_columns::<3>(3) * normal) };
    let weighted = columns.iter().map(|i| tau(i) * i.moments.weight);
    let mean = weighted.sum::<Vector2<f64>>() / total_weight.max(1e-12);
    let mut sums = ObserverSums {
        frames: Vec::with_capacity(columns.len()),
        own: 0.0,
        shared: RowSVector::zeros(),
        gradient: 0.0,
    };
    for i in columns {
        let deviation = tau(i) - mean;
        let f: Vector4<f64> = features.fixed_columns::<2>(0) * deviation * i.moments.weight;
        let slopes = f.fixed_rows::<2>(0);
        let of_pose = i.a.transpose() * slopes;
        sums.frames.push(SMatrix::from_fn(|row, _| match row {
            0..6 => of_pose[row],
            6 => f[2],
            _ => f[3] * i.inverse_gain,
        }));
        sums.own += deviation.dot(&slopes);
        sums.shared += slopes.transpose() * i.c;
        sums.gradient -= tau(i).dot(&i.moments.gradient.fixed_rows::<2>(0));
    }
    sums
}

impl BlockSums {
    /// Adds a tile's part of the shape, whose first block has the slot `first_slot`.
    pub fn add_shape(&mut self, tile: &TileSums, shape: &TileShape, first_slot: usize) {
        let sums = sum_observers(tile, &shape.normal);
        let functions: Vec<(usize, &FunctionValue)> = (shape.functions.iter())
            .map(|function| (self.index_of(first_slot + function.block), function))
            .collect();
        for (n, (column, b)) in functions.iter().enumerate() {
            self.gradient[*column][b.component] += sums.gradient * b.value;
            for (row, a) in &functions[..=n] {
                let product = sums.own * a.value * b.value;
                let block = self.block_mut(*row, *column);
                block[(a.component, b.component)] += product;
                // The lower triangle of a block on the diagonal.
                if row == column && a.component != b.component {
                    block[(b.component, a.component)] += product;
                }
            }
            for (observer, of_frame) in tile.columns.iter().zip(&sums.frames) {
                let block = self.block_mut(observer.frame, *column);
                let mut target = block.column_mut(b.component);
                target += of_frame * b.value;
            }
            if let Some(intrinsics) = &mut self.intrinsics {
                intrinsics.add_shape(*column, b.component, &(sums.shared * b.value));
            }
        }
    }
}
