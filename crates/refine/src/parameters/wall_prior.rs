//! Prior of a wall whose deformation is a known random field.
//!
//! Coefficients c of B-splines on a lattice make the displacement `B c` at its nodes, with B the
//! circulant or banded matrix of 1/6, 2/3, 1/6 along either axis. A field of covariance K at the
//! nodes has coefficients of covariance `B⁻¹ K B⁻ᵀ`. The correlation `exp(−x²/2ℓ²)` is the product
//! of one around the section and one along the tunnel, and so is the covariance of coefficients,
//! and its inverse. On a lattice of half of ℓ the field lies to a few thousandths; that of
//! independent B-splines that correlate in nearly the same way, 1.22 ℓ apart, leaves out 16 % of
//! it, and a bound by it is too low.

use crate::parameters::shape::ShapeModel;
use crate::parameters::shape_functions::{BLOCK_FUNCTIONS, Functions, OVALITY};
use nalgebra::{DMatrix, SMatrix};
use tunnelstitch_geometry::surface::WallPoint;

/// Distance of the nodes of the lattice over the length ℓ.
const SPACING_PER_LENGTH: f64 = 0.5;
/// Rows beyond the wall's ends that the inverse of B needs: it falls by 0.27 from row to row.
const MARGIN_ROWS: usize = 12;
/// Least variance of any combination of coefficients over that of the field, for an inverse that
/// rounding leaves as it is.
const MIN_VARIANCE: f64 = 1e-4;
/// Turns around the section by which a field correlates with itself.
const MAX_TURNS: i32 = 2;
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

/// Information on the coefficients of a model: that of a block of them with another by row and
/// column, `row ≤ column`.
pub type FieldInformation = Vec<((usize, usize), BlockInformation)>;

/// Information on two blocks of coefficients.
type BlockInformation = SMatrix<f64, BLOCK_FUNCTIONS, BLOCK_FUNCTIONS>;

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
            let around = inverse(around(columns, lags));
            let along = inverse(along(rows, lags)) / self.undulation_m.powi(2);
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

/// Covariance of coefficients around the section, for a field of variance 1.
fn around(columns: usize, length: f64) -> DMatrix<f64> {
    let distance = |a: usize, b: usize| {
        let apart = a.abs_diff(b);
        apart.min(columns - apart)
    };
    // What goes around the section correlates by every turn.
    let of_turns = |spacings: f64| {
        let turns = -MAX_TURNS..=MAX_TURNS;
        let at = |turn: i32| correlation(spacings + f64::from(turn) * columns as f64, length);
        turns.map(at).sum()
    };
    of_coefficients(columns, distance, of_turns)
}

/// Covariance of coefficients along the tunnel, for a field of variance 1.
fn along(rows: usize, length: f64) -> DMatrix<f64> {
    let nodes = rows + 2 * MARGIN_ROWS;
    let wide = of_coefficients(nodes, usize::abs_diff, |spacings| {
        correlation(spacings, length)
    });
    let shape = (rows, rows);
    wide.view((MARGIN_ROWS, MARGIN_ROWS), shape).into_owned()
}

/// Correlation of the field at nodes a number of spacings apart, ℓ being `length` spacings.
fn correlation(spacings: f64, length: f64) -> f64 {
    (-0.5 * (spacings / length).powi(2)).exp()
}

/// `B⁻¹ K B⁻ᵀ` of `count` nodes, with their distances in spacings and the correlation at these.
fn of_coefficients(
    count: usize,
    distance: impl Fn(usize, usize) -> usize,
    correlation: impl Fn(f64) -> f64,
) -> DMatrix<f64> {
    let spline = DMatrix::from_fn(count, count, |a, b| match distance(a, b) {
        0 => 2.0 / 3.0,
        1 => 1.0 / 6.0,
        _ => 0.0,
    });
    let at_nodes = |a, b| correlation(distance(a, b) as f64);
    let covariance = DMatrix::from_fn(count, count, at_nodes);
    // The eigenvalues of B are 1/3 to 1.
    let inverse = inverse(spline);
    &inverse * covariance * &inverse
}

/// The inverse of a symmetric matrix of eigenvalues from [`MIN_VARIANCE`] on; smaller ones are
/// taken for that.
fn inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let mut eigen = matrix.symmetric_eigen();
    eigen
        .eigenvalues
        .apply(|value| *value = 1.0 / value.max(MIN_VARIANCE));
    eigen.recompose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Variance and correlation of the undulation are those of the field, shorter than the section
    /// or as long.
    #[test]
    fn the_lattice_correlates_as_the_field_does() {
        for length_m in [0.8, 2.5] {
            let prior = WallPrior {
                undulation_m: 0.003,
                undulation_length_m: length_m,
                ..WallPrior::default()
            };
            let model = prior.model(1.5 * TAU, [0.0, 5.0]);
            let covariance = covariance_of(&prior, &model);
            let weights = |s_m: f64, h_m: f64| {
                let mut weights = DMatrix::zeros(covariance.nrows(), 1);
                for value in model.functions_at(WallPoint { s_m, h_m }) {
                    weights[BLOCK_FUNCTIONS * value.block + value.component] = value.value;
                }
                weights
            };
            let here = weights(2.13, 2.4);
            for (ds_m, dh_m) in [(0.0, 0.0), (0.3, 0.0), (0.0, 0.5), (0.8, 0.4), (-1.2, 0.9)] {
                let there = weights(2.13 + ds_m, 2.4 + dh_m);
                let found = (here.transpose() * &covariance * there)[(0, 0)] / 0.003f64.powi(2);
                let squares = |ds_m: f64| ds_m.powi(2) + dh_m.powi(2);
                let of_turn = |turn: i32| {
                    let squares = squares(ds_m + 1.5 * TAU * f64::from(turn));
                    (-0.5 * squares / length_m.powi(2)).exp()
                };
                let expected: f64 = (-1..=1).map(of_turn).sum();
                assert!(
                    (found - expected).abs() < 0.01,
                    "{length_m} {ds_m} {dh_m}: {found} {expected}"
                );
            }
        }
    }

    /// Covariance of all coefficients of a model.
    fn covariance_of(prior: &WallPrior, model: &ShapeModel) -> DMatrix<f64> {
        let unknowns = BLOCK_FUNCTIONS * model.blocks();
        let mut information = DMatrix::zeros(unknowns, unknowns);
        for ((row, column), block) in prior.information(model) {
            let [row, column] = [row, column].map(|k| BLOCK_FUNCTIONS * k);
            let shape = (BLOCK_FUNCTIONS, BLOCK_FUNCTIONS);
            information.view_mut((row, column), shape).copy_from(&block);
            let block = block.transpose();
            information.view_mut((column, row), shape).copy_from(&block);
        }
        information.try_inverse().unwrap()
    }
}
