//! Prior of a wall whose deformation is a known random field.
//!
//! Coefficients c of B-splines on a lattice make the displacement `B c` at its nodes, with B the
//! circulant or banded matrix of 1/6, 2/3, 1/6 along either axis. A field of covariance K at the
//! nodes has coefficients of covariance `B⁻¹ K B⁻ᵀ`. The correlation `exp(−x²/2ℓ²)` is the product
//! of one around the section and one along the tunnel, and so is the covariance of coefficients,
//! and its inverse. On a lattice of half of ℓ the field lies to a few thousandths; that of
//! independent B-splines that correlate in nearly the same way, 1.22 ℓ apart, leaves out 16 % of
//! it, and a bound by it is too low.

use crate::linear::normal_equations::Block;
use crate::parameters::shape::ShapeModel;
use crate::parameters::shape_functions::{BLOCK_FUNCTIONS, Functions, OVALITY};
use nalgebra::DMatrix;
use tunnelstitch_geometry::surface::WallPoint;

/// Distance of the nodes of the lattice over the length ℓ.
const SPACING_PER_LENGTH: f64 = 0.5;
/// Rows beyond the wall's ends that the inverse of B needs: it falls by 0.27 from row to row.
const MARGIN_ROWS: usize = 12;
/// Share of the variance that is added to every coefficient, for an inverse that rounding leaves as
/// it is.
const NUGGET: f64 = 1e-4;
/// Strength of the lattice over that of the undulation: its own prior is none.
const FREE: f64 = 1e3;

/// Deformation of a wall as a random field of known size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallPrior {
    /// Amplitude of the ovality, metres.
    pub ovality_m: f64,
    /// Undulation, root mean square, metres.
    pub undulation_m: f64,
    /// Length ℓ of the undulation's correlation `exp(−x²/2ℓ²)`, metres.
    pub undulation_length_m: f64,
}

/// Information on the coefficients of a model: blocks by row and column, `row ≤ column`.
pub type FieldInformation = Vec<((usize, usize), Block)>;

impl WallPrior {
    /// The functions of such a wall between two chainages, metres. The ovality has its strength,
    /// the lattice is free but for [`WallPrior::information`].
    pub fn model(&self, perimeter_m: f64, extent_h_m: [f64; 2]) -> ShapeModel {
        let mut model = ShapeModel::empty(perimeter_m, WallPoint::default(), extent_h_m);
        if self.ovality_m > 0.0 {
            // The mean square of cos² and sin² is a half each.
            model.add(OVALITY, self.ovality_m * 0.5f64.sqrt());
        }
        if self.undulation_m > 0.0 {
            let spacing_m = SPACING_PER_LENGTH * self.undulation_length_m;
            let functions = model.lattice_functions(perimeter_m / spacing_m);
            model.add(functions, FREE * self.undulation_m);
        }
        model
    }

    /// The inverse of the covariance of the coefficients of a [`WallPrior::model`]'s lattice; empty
    /// without undulation.
    pub fn information(&self, model: &ShapeModel) -> FieldInformation {
        let scales = model.scales.iter().zip(model.ranges());
        let lattices = scales.filter_map(|(scale, range)| match scale.functions {
            Functions::Lattice { columns, rows, .. } => Some((columns, rows, range.start)),
            Functions::Harmonics { .. } => None,
        });
        let of_lattice = |(columns, rows, first): (usize, usize, usize)| {
            let lags = self.undulation_length_m / model.spacing_m(columns);
            let around = inverse(&around(columns, lags));
            let along = inverse(&along(rows, lags)) / self.undulation_m.powi(2);
            let blocks = columns / BLOCK_FUNCTIONS;
            let of_pair = move |column: usize, row: usize| {
                let [a, b] = [row, column].map(|k| BLOCK_FUNCTIONS * (k % blocks));
                let part = around.fixed_view::<BLOCK_FUNCTIONS, BLOCK_FUNCTIONS>(a, b);
                let block = part * along[(row / blocks, column / blocks)];
                ((first + row, first + column), block)
            };
            let pairs = (0..rows * blocks).flat_map(|k| (0..=k).map(move |j| (k, j)));
            pairs.map(move |(k, j)| of_pair(k, j))
        };
        lattices.flat_map(of_lattice).collect()
    }
}

/// Correlation of the field at nodes a number of spacings apart, ℓ being `length` spacings.
fn correlation(spacings: f64, length: f64) -> f64 {
    (-0.5 * (spacings / length).powi(2)).exp()
}

/// Covariance of coefficients around the section, for a field of variance 1.
fn around(columns: usize, length: f64) -> DMatrix<f64> {
    let distance = |a: usize, b: usize| {
        let apart = a.abs_diff(b);
        apart.min(columns - apart)
    };
    of_coefficients(columns, length, distance)
}

/// Covariance of coefficients along the tunnel, for a field of variance 1.
fn along(rows: usize, length: f64) -> DMatrix<f64> {
    let wide = of_coefficients(rows + 2 * MARGIN_ROWS, length, usize::abs_diff);
    let shape = (rows, rows);
    wide.view((MARGIN_ROWS, MARGIN_ROWS), shape).into_owned()
}

/// `B⁻¹ K B⁻ᵀ` of `count` nodes, with their distances in spacings.
fn of_coefficients(
    count: usize,
    length: f64,
    distance: impl Fn(usize, usize) -> usize,
) -> DMatrix<f64> {
    let spline = DMatrix::from_fn(count, count, |a, b| match distance(a, b) {
        0 => 2.0 / 3.0,
        1 => 1.0 / 6.0,
        _ => 0.0,
    });
    let at_nodes = |a, b| correlation(distance(a, b) as f64, length);
    let covariance = DMatrix::from_fn(count, count, at_nodes);
    // B is symmetric, and diagonally dominant.
    let inverse = spline
        .try_inverse()
        .unwrap_or_else(|| DMatrix::identity(count, count));
    &inverse * covariance * inverse.transpose()
}

/// The inverse of a covariance of variance about 1, with the nugget.
fn inverse(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let count = covariance.nrows();
    let certain = covariance + DMatrix::identity(count, count) * NUGGET;
    match certain.cholesky() {
        Some(factor) => factor.inverse(),
        None => DMatrix::identity(count, count),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Variance and correlation of the undulation are those of the field.
    #[test]
    fn the_lattice_correlates_as_the_field_does() {
        let prior = WallPrior {
            undulation_m: 0.003,
            undulation_length_m: 0.8,
            ..WallPrior::default()
        };
        let model = prior.model(1.5 * TAU, [0.0, 5.0]);
        let unknowns = BLOCK_FUNCTIONS * model.blocks();
        let mut information = DMatrix::zeros(unknowns, unknowns);
        for ((row, column), block) in prior.information(&model) {
            let at = [row, column].map(|k| BLOCK_FUNCTIONS * k);
            let shape = (BLOCK_FUNCTIONS, BLOCK_FUNCTIONS);
            information
                .view_mut((at[0], at[1]), shape)
                .copy_from(&block);
            let block = block.transpose();
            information
                .view_mut((at[1], at[0]), shape)
                .copy_from(&block);
        }
        let covariance = information.try_inverse().unwrap();
        let weights = |wall: WallPoint| {
            let mut weights = DMatrix::zeros(unknowns, 1);
            for value in model.functions_at(wall) {
                weights[BLOCK_FUNCTIONS * value.block + value.component] = value.value;
            }
            weights
        };
        let at = |s_m: f64, h_m: f64| weights(WallPoint { s_m, h_m });
        let here = at(2.13, 2.4);
        for (ds_m, dh_m) in [(0.0, 0.0), (0.3, 0.0), (0.0, 0.5), (0.8, 0.4), (-1.2, 0.9)] {
            let there = at(2.13 + ds_m, 2.4 + dh_m);
            let found = (here.transpose() * &covariance * there)[(0, 0)] / 0.003f64.powi(2);
            let distance = f64::hypot(ds_m, dh_m);
            let expected = (-0.5 * (distance / 0.8f64).powi(2)).exp();
            assert!(
                (found - expected).abs() < 0.01,
                "{ds_m} {dh_m}: {found} {expected}"
            );
        }
    }
}
