//! Normal equations of measured points in the coefficients of the wall's shape.
//!
//! A point at the distance y from the wall with its known displacement observes
//! `δ(s, h) = Σ_j c_j φ_j(s, h)` ([`crate::parameters::shape`]) with the information `w/σ²`, w its
//! robust weight and σ the noise of a point ([`crate::point_fit`]). Its cost is
//! `½ (w/σ²) (Σ_j c_j φ_j − y)²`, so that all of them have
//!
//! `E(c) = ½ cᵀ H c − bᵀ c + ½ e`,  `H = Σ (w/σ²) φ φᵀ`,  `b = Σ (w/σ²) y φ`,
//! `e = Σ (w/σ²) y²`,
//!
//! and the gradient `H c − b`: exact, as distances do not depend on the poses. H and b are summed
//! once for a problem, and added in every linearisation.

use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use crate::parameters::shape::{FunctionValue, ShapeModel};
use crate::parameters::shape_functions::ShapeStep;
use crate::points::observations::{PointObservation, PointObservations};
use nalgebra::SMatrix;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;
use std::sync::Arc;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Cells whose sums are held before they are added: bounds the memory.
const BATCH: usize = 64;

/// Normal equations of points for a model of the wall's shape.
#[derive(Clone, Debug)]
pub struct PointEquations {
    model: ShapeModel,
    observations: Arc<PointObservations>,
    /// Blocks of H by row and column, `row ≤ column`, counted from the first block of the shape.
    blocks: BTreeMap<(usize, usize), Block>,
    /// b.
    right: Vec<ShapeStep>,
    /// e.
    square: f64,
}

/// Sums over the points of a cell.
struct CellSums {
    /// The blocks that the cell depends on, ascending.
    blocks: Vec<usize>,
    /// Their part of H: the upper blocks, row by row.
    products: Vec<Block>,
    /// Their part of b.
    right: Vec<ShapeStep>,
    /// Their part of e.
    square: f64,
}

impl PointEquations {
    /// Sums the equations of `observations` in the coefficients of `model`.
    pub fn new(observations: Arc<PointObservations>, model: &ShapeModel) -> Self {
        let mut equations = Self {
            model: model.clone(),
            blocks: BTreeMap::new(),
            right: vec![ShapeStep::zeros(); model.blocks()],
            square: 0.0,
            observations: Arc::clone(&observations),
        };
        for batch in observations.cells.chunks(BATCH) {
            for cell in batch.par_map(|cell| CellSums::new(cell, model)) {
                equations.add(&cell);
            }
        }
        equations
    }

    /// Adds the sums of a cell.
    fn add(&mut self, cell: &CellSums) {
        let mut products = cell.products.iter();
        for (n, row) in cell.blocks.iter().enumerate() {
            for (column, product) in cell.blocks[n..].iter().zip(&mut products) {
                let block = self.blocks.entry((*row, *column));
                *block.or_insert_with(Block::zeros) += product;
            }
            self.right[*row] += cell.right[n];
        }
        self.square += cell.square;
    }

    /// Pairs of blocks of the shape that have points in common, counted from the first.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        self.blocks.keys().copied()
    }

    /// Adds H to the blocks of a matrix; `first`: slot of the first block of the shape.
    pub fn add_information(&self, pattern: &Pattern, first: usize, normal: &mut NormalEquations) {
        for ((row, column), block) in &self.blocks {
            normal.add_block(pattern, first + row, first + column, block);
        }
    }

    /// Adds H and the gradient at the coefficients `shape`, and returns the cost; `first`: slot of
    /// the first block of the shape.
    pub fn add_to(
        &self,
        shape: &[ShapeStep],
        pattern: &Pattern,
        first: usize,
        normal: &mut NormalEquations,
    ) -> f64 {
        self.add_information(pattern, first, normal);
        let mut gradient: Vec<ShapeStep> = self.right.iter().map(|right| -right).collect();
        for ((row, column), block) in &self.blocks {
            gradient[*row] += block * shape[*column];
            if row != column {
                gradient[*column] += block.transpose() * shape[*row];
            }
        }
        let mut cost = 0.5 * self.square;
        for (k, (of_block, c)) in gradient.iter().zip(shape).enumerate() {
            normal.gradient[first + k] += of_block;
            // ½ cᵀ H c − bᵀ c = ½ cᵀ (g − b).
            cost += 0.5 * c.dot(&(of_block - self.right[k]));
        }
        cost
    }

    /// Adds draws of a normal vector with the covariance H, a column each, to the slots of the
    /// shape in `z`.
    pub fn add_draws<const C: usize>(
        &self,
        z: &mut [SMatrix<f64, FRAME_PARAMETERS, C>],
        rng: &mut ChaCha8Rng,
    ) {
        for point in self.observations.cells.iter().flatten() {
            let root = point.information.sqrt();
            let normal: [f64; C] = std::array::from_fn(|_| {
                let normal: f64 = StandardNormal.sample(rng);
                root * normal
            });
            for function in self.model.functions_at(point.wall) {
                let block = &mut z[function.block];
                for (column, normal) in normal.iter().enumerate() {
                    block[(function.component, column)] += function.value * normal;
                }
            }
        }
    }
}

impl CellSums {
    /// Sums over the points of a cell.
    fn new(cell: &[PointObservation], model: &ShapeModel) -> Self {
        let functions: Vec<Vec<FunctionValue>> = cell
            .iter()
            .map(|point| model.functions_at(point.wall))
            .collect();
        let all = functions.iter().flatten();
        let mut blocks: Vec<usize> = all.map(|function| function.block).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let n = blocks.len();
        let index = |block: usize| blocks.binary_search(&block).unwrap_or(0);
        // Upper blocks row by row: row r begins after those of the rows before.
        let place = |row: usize, column: usize| row * n - row * (row + 1) / 2 + column;
        let mut sums = Self {
            products: vec![Block::zeros(); n * (n + 1) / 2],
            right: vec![ShapeStep::zeros(); n],
            square: 0.0,
            blocks: Vec::new(),
        };
        for (point, functions) in cell.iter().zip(&functions) {
            let local: Vec<(usize, &FunctionValue)> = functions
                .iter()
                .map(|function| (index(function.block), function))
                .collect();
            let weighted = point.information * point.distance_m;
            for (k, (row, a)) in local.iter().enumerate() {
                sums.right[*row][a.component] += weighted * a.value;
                for (column, b) in &local[k..] {
                    let product = point.information * a.value * b.value;
                    let block = &mut sums.products[place(*row, *column)];
                    block[(a.component, b.component)] += product;
                    // The lower triangle of a block on the diagonal.
                    if row == column && a.component != b.component {
                        block[(b.component, a.component)] += product;
                    }
                }
            }
            sums.square += weighted * point.distance_m;
        }
        sums.blocks = blocks;
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use tunnelstitch_geometry::surface::WallPoint;

    fn model() -> ShapeModel {
        ShapeModel::new(18.0, WallPoint { s_m: 0.3, h_m: 0.1 }, [0.0, 4.0], 16, 0.01)
    }

    fn observations() -> Arc<PointObservations> {
        let point = |k: usize| PointObservation {
            wall: WallPoint {
                s_m: 0.71 * k as f64,
                h_m: 0.13 * k as f64,
            },
            distance_m: 1e-3 * (k as f64).sin(),
            information: 1e4 + k as f64,
        };
        let cells = (0..10).map(|cell| (0..3).map(|k| point(3 * cell + k)).collect());
        Arc::new(PointObservations {
            cells: cells.collect(),
        })
    }

    fn coefficients(model: &ShapeModel) -> Vec<ShapeStep> {
        let block = |k: usize| ShapeStep::from_fn(|n, _| 1e-3 * ((7 * k + n) as f64).cos());
        (0..model.blocks()).map(block).collect()
    }

    fn cost(model: &ShapeModel, shape: &[ShapeStep]) -> f64 {
        let observations = observations();
        let points = observations.cells.iter().flatten();
        let of_point = |point: &PointObservation| {
            let functions = model.functions_at(point.wall).into_iter();
            let delta_m: f64 = functions
                .map(|f| f.value * shape[f.block][f.component])
                .sum();
            0.5 * point.information * (delta_m - point.distance_m).powi(2)
        };
        points.map(of_point).sum()
    }

    #[test]
    fn cost_and_gradient_are_those_of_the_points() {
        let model = model();
        let equations = PointEquations::new(observations(), &model);
        let pattern = Pattern::new(model.blocks() + 1, shifted(&equations));
        let mut normal = NormalEquations::zeros(&pattern);
        let shape = coefficients(&model);
        let sum = equations.add_to(&shape, &pattern, 1, &mut normal);
        let expected = cost(&model, &shape);
        assert!((sum / expected - 1.0).abs() < 1e-9, "{sum} {expected}");
        for (block, component) in [(0, 3), (2, 1), (9, 7)] {
            let at = |step: f64| {
                let mut moved = shape.clone();
                moved[block][component] += step;
                cost(&model, &moved)
            };
            let numeric = (at(1e-4) - at(-1e-4)) / 2e-4;
            let analytic = normal.gradient[1 + block][component];
            assert!((numeric - analytic).abs() < 1e-6 * (1.0 + numeric.abs()));
            // The cost is quadratic, so its second difference is exact.
            let second = (at(1e-3) + at(-1e-3) - 2.0 * at(0.0)) / 1e-6;
            let index = pattern.block_index(1 + block, 1 + block).unwrap();
            let own = normal.blocks[index][(component, component)];
            assert!((second - own).abs() < 1e-5 * (1.0 + own), "{second} {own}");
        }
    }

    #[test]
    fn draws_have_the_covariance_of_the_equations() {
        const DRAWS: usize = 2000;
        let model = model();
        let equations = PointEquations::new(observations(), &model);
        let mut z = vec![SMatrix::<f64, FRAME_PARAMETERS, DRAWS>::zeros(); model.blocks()];
        equations.add_draws(&mut z, &mut ChaCha8Rng::seed_from_u64(1));
        for ((row, column), block) in equations.blocks.iter().take(6) {
            let drawn = z[*row] * z[*column].transpose() / DRAWS as f64;
            let scale = equations.blocks[&(*row, *row)].trace().sqrt()
                * equations.blocks[&(*column, *column)].trace().sqrt();
            assert!((drawn - block).amax() < 0.1 * scale, "{row} {column}");
        }
    }

    fn shifted(equations: &PointEquations) -> Vec<(usize, usize)> {
        equations.pairs().map(|(a, b)| (a + 1, b + 1)).collect()
    }
}
