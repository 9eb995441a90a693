//! Shape of the wall: its displacement from the nominal surface, a sum of functions of several
//! scales.
//!
//! The displacement ([`tunnelstitch_geometry::surface::RadialField`]) is
//!
//! `δ(s, h) = Σ_k Σ_j c_kj φ_kj(s, h)`,  `c_kj ~ N(0, σ_k²)`,
//!
//! with one strength σ_k for all coefficients of a scale k ([`Scale`]):
//!
//! | scale | functions φ |
//! | --- | --- |
//! | ovality | cos 2θ and sin 2θ, constant along the tunnel |
//! | harmonics | cos mθ and sin mθ, m = 3 … 5, constant along the tunnel |
//! | lattices of 8, 16, 32, … columns | cubic B-splines: undulations of a quarter of the perimeter and shorter |
//!
//! Each lattice has half the spacing of the one before, so that the sum is a B-spline on the
//! finest. Strengths are learned from the frames ([`crate::solver::shape_evidence`]): a wall that
//! is as planned has none. A scale of strength 0 has no coefficients.
//!
//! Coefficients come in blocks of eight, as many as a frame has parameters, so that the normal
//! equations have blocks of one size ([`crate::linear::normal_equations`]): neighbours in a row of
//! a lattice, or the harmonics of a scale, and then coefficients of no function, which stay at
//! their prior.
//!
//! Source: C. K. Chui, "An Introduction to Wavelets", 1992 (splines of halved spacing); D. J. C.
//! MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992 (strengths by evidence).

use crate::parameters::shape_functions::{
    BLOCK_FUNCTIONS, Functions, HIGHER_HARMONICS, OVALITY, ShapeStep, harmonic,
};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::ops::Range;
use tunnelstitch_geometry::surface::{RadialField, SplineLattice, WallPoint};

/// Columns of the coarsest lattice.
const MIN_COLUMNS: usize = BLOCK_FUNCTIONS;
/// One scale of the shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Its functions.
    pub functions: Functions,
    /// Strength σ: 1-σ of each coefficient, metres.
    pub sigma_m: f64,
}

/// The functions of a wall's shape, and the prior of their coefficients.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeModel {
    /// Perimeter of the nominal section, metres.
    perimeter_m: f64,
    /// Origin of the lattices.
    origin: WallPoint,
    /// Chainage between which the wall has a shape, metres.
    extent_h_m: [f64; 2],
    /// The scales.
    pub scales: Vec<Scale>,
    /// Scales that the wall is not seen to have, with the size from which on they would be seen.
    pub dropped: Vec<Scale>,
}

/// A wall's shape: coefficients of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// The model.
    pub model: ShapeModel,
    /// Its coefficients, metres, scale by scale, block by block.
    pub coefficients: Vec<ShapeStep>,
}

/// A function that is not zero at a point of the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FunctionValue {
    /// Block of its coefficient.
    pub block: usize,
    /// Its coefficient in the block.
    pub component: usize,
    /// φ.
    pub value: f64,
}

impl ShapeModel {
    /// Harmonics and lattices of 8, 16, … up to `finest` columns, all of the strength `sigma_m`,
    /// for the wall between two chainages, metres; `origin`: node of the lattices.
    pub fn new(
        perimeter_m: f64,
        origin: WallPoint,
        extent_h_m: [f64; 2],
        finest: usize,
        sigma_m: f64,
    ) -> Self {
        let mut model = Self::empty(perimeter_m, origin, extent_h_m);
        model.add(OVALITY, sigma_m);
        model.add(HIGHER_HARMONICS, sigma_m);
        let mut columns = MIN_COLUMNS;
        while columns <= finest {
            model.add(model.lattice_of(columns), sigma_m);
            columns *= 2;
        }
        model
    }

    /// A model without functions, for the wall between two chainages, metres; `origin`: node of
    /// the lattices.
    pub fn empty(perimeter_m: f64, origin: WallPoint, extent_h_m: [f64; 2]) -> Self {
        Self {
            perimeter_m,
            origin,
            extent_h_m,
            scales: Vec::new(),
            dropped: Vec::new(),
        }
    }

    /// Adds functions of the strength `sigma_m`.
    pub fn add(&mut self, functions: Functions, sigma_m: f64) {
        self.scales.push(Scale { functions, sigma_m });
    }

    /// The B-splines of the lattice whose number of columns is nearest to `columns`, by ratio.
    pub fn lattice_functions(&self, columns: f64) -> Functions {
        let halvings = (columns / MIN_COLUMNS as f64).log2().round().max(0.0);
        self.lattice_of(MIN_COLUMNS << halvings as usize)
    }

    /// The lattice of `columns` columns.
    fn lattice(&self, columns: usize) -> SplineLattice {
        SplineLattice {
            perimeter_m: self.perimeter_m,
            columns,
            origin: self.origin,
        }
    }

    /// The B-splines of the lattice of `columns` columns.
    fn lattice_of(&self, columns: usize) -> Functions {
        let [from, to] = self.extent_h_m;
        let rows = self.lattice(columns).rows_between(from, to);
        Functions::Lattice {
            columns,
            first_row: rows.start,
            rows: (rows.end - rows.start) as usize,
        }
    }

    /// Chainage between which the wall has a shape, metres.
    pub fn extent_h_m(&self) -> [f64; 2] {
        self.extent_h_m
    }

    /// Distance of the nodes of a lattice, metres.
    pub fn spacing_m(&self, columns: usize) -> f64 {
        self.lattice(columns).spacing_m()
    }

    /// Number of blocks of coefficients.
    pub fn blocks(&self) -> usize {
        self.scales.iter().map(|s| s.functions.blocks()).sum()
    }

    /// The blocks of each scale.
    pub fn ranges(&self) -> Vec<Range<usize>> {
        let mut next = 0;
        let range = |scale: &Scale| {
            let start = next;
            next += scale.functions.blocks();
            start..next
        };
        self.scales.iter().map(range).collect()
    }

    /// Strength of every block, metres.
    pub fn block_sigmas_m(&self) -> Vec<f64> {
        let scales = self.scales.iter();
        scales
            .flat_map(|scale| std::iter::repeat_n(scale.sigma_m, scale.functions.blocks()))
            .collect()
    }

    /// The functions that are not zero at a point of the wall, by ascending block.
    pub fn functions_at(&self, wall: WallPoint) -> Vec<FunctionValue> {
        let mut values = Vec::with_capacity(16 * self.scales.len());
        let mut first = 0;
        for scale in &self.scales {
            match scale.functions {
                Functions::Harmonics {
                    first_order,
                    orders,
                } => {
                    let theta = TAU * (wall.s_m - self.origin.s_m) / self.perimeter_m;
                    values.extend((0..2 * orders).map(|component| FunctionValue {
                        block: first,
                        component,
                        value: harmonic(first_order, component, theta),
                    }));
                }
                Functions::Lattice {
                    columns,
                    first_row,
                    rows,
                } => {
                    let support = self.lattice(columns).support(wall);
                    for (j, along_h) in support.along_h.into_iter().enumerate() {
                        let row = support.first_row + j as i64 - first_row;
                        if !(0..rows as i64).contains(&row) {
                            continue;
                        }
                        for (column, along_s) in support.columns.into_iter().zip(support.along_s) {
                            let index = row as usize * columns + column;
                            values.push(FunctionValue {
                                block: first + index / BLOCK_FUNCTIONS,
                                component: index % BLOCK_FUNCTIONS,
                                value: along_h * along_s,
                            });
                        }
                    }
                }
            }
            first += scale.functions.blocks();
        }
        values.sort_unstable_by_key(|value| (value.block, value.component));
        values
    }

    /// The deformation at a point of the wall as a sum of coefficients, block by block: the
    /// displacement without mean, cos θ and sin θ of the section
    /// ([`Functions::retain_deformation`]).
    pub fn deformation_at(&self, wall: WallPoint) -> Vec<ShapeStep> {
        let mut sum = vec![ShapeStep::zeros(); self.blocks()];
        for function in self.functions_at(wall) {
            sum[function.block][function.component] = function.value;
        }
        for (scale, range) in self.scales.iter().zip(self.ranges()) {
            scale.functions.retain_deformation(&mut sum[range]);
        }
        sum
    }

    /// The displacement with the given coefficients, metres; None if there are no functions.
    pub fn field_of(&self, coefficients: Vec<ShapeStep>) -> Option<RadialField> {
        let shape = Shape {
            model: self.clone(),
            coefficients,
        };
        shape.field()
    }

    /// The finest lattice of the model, or one that is fine enough for the harmonics.
    fn finest_columns(&self) -> usize {
        let finest = self.finest_lattice().map_or(0, |(columns, _)| columns);
        finest.max(4 * MIN_COLUMNS)
    }

    /// Columns and strength (metres) of the finest lattice; None if there is none.
    pub fn finest_lattice(&self) -> Option<(usize, f64)> {
        let lattices = self
            .scales
            .iter()
            .filter_map(|scale| match scale.functions {
                Functions::Harmonics { .. } => None,
                Functions::Lattice { columns, .. } => Some((columns, scale.sigma_m)),
            });
        lattices.max_by_key(|(columns, _)| *columns)
    }

    /// The model with one scale alone.
    pub fn with_only(&self, scale: Scale) -> Self {
        Self {
            scales: vec![scale],
            ..self.clone()
        }
    }

    /// The model with a lattice of half the spacing added, of the strength `sigma_m`.
    pub fn refined(&self, sigma_m: f64) -> Self {
        let mut model = self.clone();
        model.add(self.lattice_of(2 * self.finest_columns()), sigma_m);
        model
    }
}

impl Shape {
    /// The nominal wall, in the terms of a model.
    pub fn nominal(model: ShapeModel) -> Self {
        Self {
            coefficients: vec![ShapeStep::zeros(); model.blocks()],
            model,
        }
    }

    /// The displacement of the wall; None if there are no functions.
    pub fn field(&self) -> Option<RadialField> {
        let model = &self.model;
        if model.scales.is_empty() {
            return None;
        }
        let finest = model.finest_columns();
        let mut field: Option<RadialField> = None;
        let mut columns = MIN_COLUMNS;
        while columns <= finest {
            field = field.map(|field| field.halved());
            for (scale, range) in model.scales.iter().zip(model.ranges()) {
                let Functions::Lattice {
                    columns: own,
                    first_row,
                    ..
                } = scale.functions
                else {
                    continue;
                };
                if own == columns {
                    let blocks = self.coefficients[range].iter();
                    let coefficients = blocks.flat_map(|block| block.iter().copied()).collect();
                    let own = RadialField::new(model.lattice(columns), first_row, coefficients);
                    field = Some(match field {
                        Some(coarser) => coarser.plus(&own),
                        None => own,
                    });
                }
            }
            columns *= 2;
        }
        for (scale, range) in model.scales.iter().zip(model.ranges()) {
            let Functions::Harmonics {
                first_order,
                orders,
            } = scale.functions
            else {
                continue;
            };
            let amplitudes = &self.coefficients[range.start].as_slice()[..2 * orders];
            let own = self.harmonics(first_order, amplitudes, finest);
            field = Some(match field {
                Some(sum) => sum.plus(&own),
                None => own,
            });
        }
        field
    }

    /// Harmonics of some amplitudes, metres, as a B-spline on a lattice; `first_order`: m of the
    /// first two.
    ///
    /// The spline with the coefficients `cos mθ_i / β` at the nodes, `β = (2 + cos(2π m/n))/3`,
    /// interpolates cos mθ there.
    fn harmonics(&self, first_order: usize, amplitudes: &[f64], columns: usize) -> RadialField {
        let value = |column: usize| -> f64 {
            let step = TAU / columns as f64;
            let terms = amplitudes.iter().enumerate().map(|(component, amplitude)| {
                let order = (first_order + component / 2) as f64;
                let beta = (2.0 + (order * step).cos()) / 3.0;
                amplitude * harmonic(first_order, component, column as f64 * step) / beta
            });
            terms.sum()
        };
        let row: Vec<f64> = (0..columns).map(value).collect();
        let lattice = self.model.lattice(columns);
        let [from, to] = self.model.extent_h_m;
        let rows = lattice.rows_between(from, to);
        let coefficients = rows.clone().flat_map(|_| row.clone()).collect();
        RadialField::new(lattice, rows.start, coefficients)
    }

    /// The shape after a step.
    pub fn stepped(&self, step: &[ShapeStep]) -> Vec<ShapeStep> {
        let coefficients = self.coefficients.iter().zip(step);
        coefficients.map(|(c, step)| c + step).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape() -> Shape {
        let model = ShapeModel::new(
            3.0 * TAU,
            WallPoint { s_m: 1.0, h_m: 0.3 },
            [-0.5, 6.0],
            32,
            0.005,
        );
        let coefficients = (0..model.blocks())
            .map(|k| ShapeStep::from_fn(|n, _| (12.9898 * (k * 8 + n) as f64).sin()))
            .collect();
        Shape {
            model,
            coefficients,
        }
    }

    /// Sum of the functions times their coefficients.
    fn sum(shape: &Shape, wall: WallPoint) -> f64 {
        let functions = shape.model.functions_at(wall).into_iter();
        functions
            .map(|f| f.value * shape.coefficients[f.block][f.component])
            .sum()
    }

    #[test]
    fn the_field_is_the_sum_of_the_functions() {
        let shape = shape();
        let field = shape.field().unwrap();
        for (s_m, h_m) in [(0.1, 0.0), (18.0, 3.3), (7.0, 5.9), (11.0, -0.4)] {
            let wall = WallPoint { s_m, h_m };
            let difference = field.at(wall).delta_m - sum(&shape, wall);
            // Harmonics are splines to a thousandth.
            assert!(difference.abs() < 3e-3, "{difference}");
        }
    }

    #[test]
    fn functions_of_strength_one_have_the_stated_size() {
        let model = ShapeModel::new(18.0, WallPoint::default(), [0.0, 9.0], 8, 1.0);
        let mut squares = [0.0; 3];
        for k in 0..1000 {
            let wall = WallPoint {
                s_m: 0.37 * f64::from(k),
                h_m: 3.0 + 0.0023 * f64::from(k),
            };
            for function in model.functions_at(wall) {
                squares[function.block.min(2)] += function.value * function.value / 1000.0;
            }
        }
        for (scale, square) in model.scales.iter().zip(squares) {
            assert!((scale.functions.rms() / f64::sqrt(square) - 1.0).abs() < 0.01);
        }
    }

    #[test]
    fn a_refined_model_has_one_more_lattice() {
        let model = shape().model;
        let refined = model.refined(0.001);
        assert_eq!(refined.scales.len(), model.scales.len() + 1);
        assert!(matches!(
            refined.scales.last().unwrap().functions,
            Functions::Lattice { columns: 64, .. }
        ));
        assert_eq!(refined.ranges().last().unwrap().end, refined.blocks());
    }

    #[test]
    fn a_shape_without_functions_is_nominal() {
        let mut model = shape().model;
        model.scales.clear();
        assert!(Shape::nominal(model).field().is_none());
    }
}
