//! Functions of the wall's shape ([`crate::parameters::shape`]).

use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Coefficients in a block.
pub const BLOCK_FUNCTIONS: usize = FRAME_PARAMETERS;
/// Harmonics of a section that are hardly seen: its mean, cos θ and sin θ.
const WEAK_HARMONICS: usize = 3;
/// The section's ovality. A lining is flattened by the ground more than it has any other harmonic,
/// so it has a strength of its own.
pub const OVALITY: Functions = Functions::Harmonics {
    first_order: 2,
    orders: 1,
};
/// The harmonics above it.
pub const HIGHER_HARMONICS: Functions = Functions::Harmonics {
    first_order: 3,
    orders: 3,
};

/// A block of coefficients, metres, or a step of them.
pub type ShapeStep = SVector<f64, BLOCK_FUNCTIONS>;

/// Functions whose coefficients have one strength.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Functions {
    /// cos mθ and sin mθ, constant along the tunnel, for some orders m.
    Harmonics {
        /// Smallest order.
        first_order: usize,
        /// Number of orders, four at the most.
        orders: usize,
    },
    /// Cubic B-splines on a lattice.
    Lattice {
        /// Columns around the section, a multiple of eight.
        columns: usize,
        /// First row.
        first_row: i64,
        /// Number of rows.
        rows: usize,
    },
}

impl Functions {
    /// Number of blocks of coefficients.
    pub fn blocks(&self) -> usize {
        match *self {
            Self::Harmonics { .. } => 1,
            Self::Lattice { columns, rows, .. } => rows * columns / BLOCK_FUNCTIONS,
        }
    }

    /// Root mean square over the wall of a displacement by functions of strength 1.
    ///
    /// A cubic B-spline has the square integral 151/315 in either direction; at any angle
    /// `cos² mθ + sin² mθ = 1`.
    pub fn rms(&self) -> f64 {
        match *self {
            Self::Harmonics { orders, .. } => (orders as f64).sqrt(),
            Self::Lattice { .. } => 151.0 / 315.0,
        }
    }

    /// Number of coefficients that [`Functions::retain_deformation`] leaves.
    pub fn deformations(&self) -> usize {
        match *self {
            Self::Harmonics { orders, .. } => 2 * orders,
            Self::Lattice { columns, rows, .. } => (columns - WEAK_HARMONICS) * rows,
        }
    }

    /// Removes mean, cos θ and sin θ from every row of coefficients, given as blocks with a vector
    /// in each column: as radius and position of the axis, these are hardly seen. Also removes the
    /// coefficients of no function.
    pub fn retain_deformation<const C: usize>(
        &self,
        blocks: &mut [SMatrix<f64, BLOCK_FUNCTIONS, C>],
    ) {
        let columns = match *self {
            Self::Harmonics { orders, .. } => {
                for block in blocks {
                    block.rows_range_mut(2 * orders..).fill(0.0);
                }
                return;
            }
            Self::Lattice { columns, .. } => columns,
        };
        let weight = |harmonic: usize, column: usize| {
            let theta = TAU * column as f64 / columns as f64;
            match harmonic {
                0 => (1.0 / columns as f64).sqrt(),
                1 => (2.0 / columns as f64).sqrt() * theta.cos(),
                _ => (2.0 / columns as f64).sqrt() * theta.sin(),
            }
        };
        for row in blocks.chunks_mut(columns / BLOCK_FUNCTIONS) {
            for harmonic in 0..WEAK_HARMONICS {
                let weights = |block: usize| {
                    let first = block * BLOCK_FUNCTIONS;
                    ShapeStep::from_fn(|k, _| weight(harmonic, first + k))
                };
                let products = row.iter().enumerate();
                let products = products.map(|(k, block)| weights(k).transpose() * block);
                let amplitude: SMatrix<f64, 1, C> = products.sum();
                for (k, block) in row.iter_mut().enumerate() {
                    *block -= weights(k) * amplitude;
                }
            }
        }
    }
}

/// The harmonic of a block's component: cos mθ for even ones, sin mθ for odd ones; `first_order`:
/// m of the first two.
pub fn harmonic(first_order: usize, component: usize, theta: f64) -> f64 {
    let angle = (first_order + component / 2) as f64 * theta;
    if component.is_multiple_of(2) {
        angle.cos()
    } else {
        angle.sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deformation_has_neither_mean_nor_first_harmonic() {
        let functions = Functions::Lattice {
            columns: 16,
            first_row: 0,
            rows: 2,
        };
        let values = |block: usize, k: usize| {
            let theta = TAU * (8 * (block % 2) + k) as f64 / 16.0;
            (2.0 + theta.cos() - 3.0 * theta.sin(), (2.0 * theta).cos())
        };
        let of = |weak: f64, block: usize| {
            ShapeStep::from_fn(|k, _| weak * values(block, k).0 + values(block, k).1)
        };
        let mut blocks: Vec<ShapeStep> = (0..4).map(|block| of(1.0, block)).collect();
        functions.retain_deformation(&mut blocks);
        for (k, block) in blocks.iter().enumerate() {
            assert!((block - of(0.0, k)).norm() < 1e-12);
        }
        assert_eq!(functions.deformations(), 32 - 6);
        let mut block = [ShapeStep::repeat(1.0)];
        OVALITY.retain_deformation(&mut block);
        assert_eq!(block[0].sum(), 2.0);
        assert_eq!(OVALITY.deformations(), 2);
    }
}
