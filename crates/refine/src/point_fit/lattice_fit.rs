//! Robust fit of the wall's shape to the distances of points.
//!
//! The unknowns are the coefficients of the shape alone ([`crate::parameters::shape`]), with the
//! priors of their scales. Strengths are learned by evidence as from frames
//! ([`crate::solver::shape_evidence`]), weights by iteration: Huber's with the given strengths,
//! then Tukey's with the learned ones, and with a finer lattice if the finest is of use. The noise
//! of a point is that of the residuals, enlarged by `√(n/(n − p))` for the p coefficients that the
//! n points determine.

use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::linear::sparse_cholesky::SymbolicFactorisation;
use crate::parameters::frame_estimate::FRAME_PARAMETERS;
use crate::parameters::shape::{Shape, ShapeModel};
use crate::parameters::shape_functions::ShapeStep;
use crate::parameters::shape_limits::with_finer_lattice;
use crate::point_fit::located_points::LocatedPoint;
use crate::point_fit::robust::{Weighting, huber_weight, robust_sigma_m, tukey_weight};
use crate::points::equations::PointEquations;
use crate::points::observations::{PointObservation, PointObservations};
use crate::solver::shape_evidence::ShapeEquations;
use nalgebra::SMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::RadialField;

/// Solves with each kind of weights; they settle to a per cent.
const ITERATIONS: usize = 4;
/// Coefficients that points determine at the most, of the points: with more, their residuals say
/// nothing of the noise.
const MAX_DETERMINED_SHARE: f64 = 0.9;
/// Draws of the errors at once, and the number of these batches. With 128 draws a 1-σ is known to
/// 6 %.
const BATCH: usize = 16;
/// See [`BATCH`].
const BATCHES: u64 = 8;

/// A shape that is fitted to points.
pub struct LatticeFit {
    /// The shape; without scales if the points show none.
    pub shape: Shape,
    /// The points with their final weights; those left out are not in it.
    pub observations: Arc<PointObservations>,
    /// 1-σ of the noise of a point, metres.
    pub sigma_m: f64,
    /// Points that are used, and those left out.
    pub counts: [usize; 2],
    /// Root mean square residual of the points used, metres.
    pub rms_m: f64,
    /// Draws of the errors of the shape; none if it has no scales.
    pub error_draws: Vec<RadialField>,
}

/// The state of the fit: points, the shape, and the noise.
struct State<'p> {
    cells: &'p [Vec<LocatedPoint>],
    shape: Shape,
    /// Residuals of the points, by cell, metres.
    residuals_m: Vec<Vec<f64>>,
    sigma_m: f64,
    /// Weight of a residual.
    weighting: Weighting,
}

/// The limits of the evidence.
#[derive(Clone, Copy, Debug)]
pub struct EvidenceLimits {
    /// Largest strength of a scale, metres.
    pub most_m: f64,
    /// Probability of finding a shape where there is none.
    pub alpha: f64,
}

/// Fits the shape with the functions and strengths of `model`; `residuals_m`: of the points about
/// their sections, by cell, for the first weights. None if the equations are singular.
pub fn fit_lattices(
    cells: &[Vec<LocatedPoint>],
    residuals_m: Vec<Vec<f64>>,
    model: ShapeModel,
    limits: EvidenceLimits,
) -> Option<LatticeFit> {
    let mut state = State {
        cells,
        shape: Shape::nominal(model),
        sigma_m: robust_sigma_m(residuals_m.iter().flatten().copied()),
        residuals_m,
        weighting: huber_weight,
    };
    for _ in 0..ITERATIONS {
        state.solve(None)?;
    }
    state.solve(Some(limits))?;
    state.shape = with_finer_lattice(state.shape);
    state.weighting = tukey_weight;
    for _ in 1..ITERATIONS {
        state.solve(None)?;
    }
    let determined = state.solve(Some(limits))?;
    state.finish(determined)
}

impl State<'_> {
    /// The points with their weights, without those of weight 0.
    fn observations(&self) -> Arc<PointObservations> {
        let information = self.sigma_m.powi(-2);
        let cells = self.cells.iter().zip(&self.residuals_m);
        let cells = cells.map(|(cell, residuals)| {
            let observation = |(point, residual): (&LocatedPoint, &f64)| PointObservation {
                wall: point.wall,
                distance_m: point.distance_m,
                information: (self.weighting)(*residual, self.sigma_m) * information,
            };
            let observations = cell.iter().zip(residuals).map(observation);
            observations.filter(|o| o.information > 0.0).collect()
        });
        Arc::new(PointObservations {
            cells: cells.filter(|cell: &Vec<_>| !cell.is_empty()).collect(),
        })
    }

    /// Solves for the shape with the present weights, and for the strengths within `limits`, if
    /// there are any; then for noise and residuals. Returns the number of coefficients that the
    /// points determine, if strengths were learned. None if the equations are singular.
    fn solve(&mut self, limits: Option<EvidenceLimits>) -> Option<f64> {
        let mut determined = 0.0;
        if !self.shape.model.scales.is_empty() {
            let points = PointEquations::new(self.observations(), &self.shape.model);
            let system = System::new(&self.shape, &points)?;
            let shape = match limits {
                None => {
                    let factor = system.factorise()?;
                    let step = factor.step(&system.normal.gradient);
                    Shape {
                        coefficients: self.shape.stepped(&step),
                        model: self.shape.model.clone(),
                    }
                }
                Some(limits) => {
                    let learned = system.equations(&self.shape);
                    let learned = learned.learn(limits.most_m, limits.alpha)?;
                    determined = learned.determined()?;
                    learned.shape_after(learned.step())
                }
            };
            self.shape = shape;
        }
        self.update_residuals();
        Some(determined)
    }

    /// Residuals of all points about the shape, and their σ.
    fn update_residuals(&mut self) {
        let field = self.shape.field();
        let delta_m = |point: &LocatedPoint| {
            field
                .as_ref()
                .map_or(0.0, |field| field.at(point.wall).delta_m)
        };
        let residuals = self.cells.par_map(|cell| {
            let residual = |point: &LocatedPoint| point.distance_m - delta_m(point);
            cell.iter().map(residual).collect::<Vec<f64>>()
        });
        self.residuals_m = residuals;
        self.sigma_m = robust_sigma_m(self.residuals_m.iter().flatten().copied());
    }

    /// The result, whose points determine so many coefficients.
    fn finish(mut self, determined: f64) -> Option<LatticeFit> {
        let all = self.residuals_m.iter().flatten();
        let inliers = all.filter(|residual| tukey_weight(**residual, self.sigma_m) > 0.0);
        let (used, square) = inliers.fold((0, 0.0), |(n, sum), e| (n + 1, sum + e * e));
        let count: usize = self.cells.iter().map(Vec::len).sum();
        let share = (determined / used as f64).min(MAX_DETERMINED_SHARE);
        let observations_before = self.observations();
        let rms_m = f64::sqrt(square / used as f64);
        self.sigma_m /= (1.0 - share).sqrt();
        // The choice of points stays; only their information is less.
        let scale = 1.0 - share;
        let cells = observations_before.cells.iter().map(|cell| {
            let scaled = |point: &PointObservation| PointObservation {
                information: point.information * scale,
                ..*point
            };
            cell.iter().map(scaled).collect()
        });
        let observations = Arc::new(PointObservations {
            cells: cells.collect(),
        });
        let points = PointEquations::new(Arc::clone(&observations), &self.shape.model);
        let error_draws = if self.shape.model.scales.is_empty() {
            Vec::new()
        } else {
            System::new(&self.shape, &points)?.error_draws(&self.shape)?
        };
        Some(LatticeFit {
            shape: self.shape,
            observations,
            sigma_m: self.sigma_m,
            counts: [used, count - used],
            rms_m,
            error_draws,
        })
    }
}

/// The equations of a shape by points and prior.
struct System<'e> {
    points: &'e PointEquations,
    pattern: Pattern,
    symbolic: SymbolicFactorisation,
    normal: NormalEquations,
}

impl<'e> System<'e> {
    /// The equations at a shape; None if they have no factorisation.
    fn new(shape: &Shape, points: &'e PointEquations) -> Option<Self> {
        let pattern = Pattern::new(shape.model.blocks(), points.pairs());
        let mut normal = NormalEquations::zeros(&pattern);
        points.add_to(&shape.coefficients, &pattern, 0, &mut normal);
        let sigmas_m = shape.model.block_sigmas_m();
        for (slot, (block, sigma_m)) in shape.coefficients.iter().zip(sigmas_m).enumerate() {
            let information = sigma_m.powi(-2);
            normal.add_block(&pattern, slot, slot, &(Block::identity() * information));
            normal.gradient[slot] += block * information;
        }
        Some(Self {
            symbolic: SymbolicFactorisation::new(&pattern).ok()?,
            points,
            pattern,
            normal,
        })
    }

    /// The factor of the normal matrix; None if it is singular.
    fn factorise(&self) -> Option<crate::linear::sparse_cholesky::Factor<'_>> {
        self.symbolic.factorise(&self.normal, 0.0).ok()
    }

    /// The equations for learning the strengths.
    fn equations(&self, shape: &Shape) -> ShapeEquations<'_> {
        ShapeEquations {
            pattern: &self.pattern,
            symbolic: &self.symbolic,
            normal: &self.normal,
            border: None,
            is_minimum: false,
            shape: shape.clone(),
            first_slot: 0,
        }
    }

    /// Draws of the errors of the shape, by the noise of the points and the prior; None if the
    /// equations are singular.
    fn error_draws(&self, shape: &Shape) -> Option<Vec<RadialField>> {
        let factor = self.factorise()?;
        let sigmas_m = shape.model.block_sigmas_m();
        let mut draws = Vec::new();
        for batch in 0..BATCHES {
            let mut rng = ChaCha8Rng::seed_from_u64(batch);
            let mut z: Vec<SMatrix<f64, FRAME_PARAMETERS, BATCH>> = sigmas_m
                .iter()
                .map(|sigma_m| {
                    SMatrix::from_fn(|_, _| {
                        let normal: f64 = StandardNormal.sample(&mut rng);
                        normal / sigma_m
                    })
                })
                .collect();
            self.points.add_draws(&mut z, &mut rng);
            let errors = factor.solve(&z);
            let field = |draw: usize| {
                let column = |block: &SMatrix<f64, FRAME_PARAMETERS, BATCH>| -> ShapeStep {
                    block.column(draw).into_owned()
                };
                shape.model.field_of(errors.iter().map(column).collect())
            };
            draws.extend((0..BATCH).par_map(field).into_iter().flatten());
        }
        Some(draws)
    }
}
