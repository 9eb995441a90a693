//! Model error: what the residuals show beyond noise enlarges the covariance, per direction.
//!
//! Where lens, shape or light are not quite as modelled, the scores of neighbouring blocks of the
//! wall err together, over distances that nobody knows beforehand. So the scatter of the scores is
//! computed over square patches of P × P blocks, `V_P = Σ_p g_p g_pᵀ`, for P = 1, 2, 4, 8. With H
//! the normal matrix, P its part by the prior and κ the curvature
//! ([`crate::uncertainty::covariance`]), its dispersion
//!
//! `c_P = (tr(H⁻¹ V_P) − tr(H_ee⁻¹ V_P,ee)) / (κ² · freedoms determined by pixels)`
//!
//! does not grow with P, but by chance, if errors of blocks are independent; it falls, as the six
//! unknowns of every frame are fitted to its patches. If it is largest at P = 1, all is noise. If
//! not, the P with the largest dispersion is the size over which errors go together, and the
//! covariance is
//!
//! `Σ = (H⁻¹ (V_P/κ² + P) H⁻¹)_pp`,
//!
//! in every direction what errors of this size, and those of the initial poses, do to the estimate.
//! Measured points of the wall ([`crate::points`]) add their information to P, and their noise to
//! what is drawn.
//!
//! It is not sparse. But for independent random signs ε, `z = Σ_p ε_p g_p/κ` has the covariance
//! `V_P/κ²`, a normal vector times the Cholesky factor of P has the covariance P, and `δ = H⁻¹ z`
//! of their sum that of the estimate. So means over some draws give all blocks of Σ, and
//! `tr(H⁻¹ V_P)` as the mean of `zᵀ H⁻¹ z`.
//!
//! A residual that errs with its neighbours tells less than one that errs by itself: by the factor
//! c_P, or c_1 if all is noise, as where compression makes errors that are not independent. With
//! all of its information the pixels would outweigh a prior that is right, and be taken for
//! evidence of a deformed wall. So if the factor is more than slightly above 1, the last solve is
//! repeated with the information of pixels divided by it
//! ([`crate::model::context::EstimationContext::dispersion`]).
//!
//! What moves all scores of a frame alike (an error that its six unknowns absorb) leaves no trace
//! in residuals: an oval tunnel, a wrong radius, a long undulation. Of these Σ knows nothing.
//!
//! Source: A. C. Cameron, J. B. Gelbach, D. L. Miller, "Bootstrap-based improvements for inference
//! with clustered errors", Review of Economics and Statistics 90(3), 2008 (random signs of
//! clusters); T. G. Conley, "GMM estimation with cross sectional dependence", Journal of
//! Econometrics 92(1), 1999 (errors correlated in space).

use crate::linear::bordered_system::SharedBlock;
use crate::linear::normal_equations::{Block, Pattern};
use crate::linear::sparse_cholesky::{Factor, SymbolicFactorisation};
use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::SHARED_PARAMETERS;
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use crate::points::equations::PointEquations;
use crate::problem::patch_scores::PatchScores;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::solver::gauss_newton::Solution;
use crate::uncertainty::covariance::NoiseCovariance;
use crate::uncertainty::exposure_equations::ExposurePattern;
use crate::uncertainty::observability::Posterior;
use crate::uncertainty::pixel_jacobians::PointJacobians;
use nalgebra::SMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::significance::normal_quantile;

/// Sizes of patches, blocks: up to about the width of a frame.
const PATCH_BLOCKS: [u32; 3] = [2, 4, 8];

/// Draws that are solved for at once.
const BATCH: usize = 16;

/// Batches of draws. With 128 draws a covariance of six unknowns is known to 6 % (1-σ), and the
/// mean of `eᵀ Σ⁻¹ e` is 128/(128 − 7) = 1.06 of what it should be.
const BATCHES: u64 = 8;

/// Errors of the estimate.
pub struct EstimateErrors {
    /// Draws of them: of those that patches and prior make, or the prior alone.
    pub draws: ErrorDraws,
    /// The patches over which errors go together; None if all is noise.
    pub patches: Option<Patches>,
    /// Draws of the errors by noise and prior together; None if `draws` has them, or if there is no
    /// shape, which alone needs them.
    noise: Option<ErrorDraws>,
}

/// Patches over which errors go together.
#[derive(Clone, Copy, Debug)]
pub struct Patches {
    /// Side, blocks.
    pub blocks: u32,
    /// Dispersion `c_P` of their scores.
    pub dispersion: f64,
}

/// Draws of the errors of an estimate, batch by batch.
pub struct ErrorDraws(Vec<DrawBatch>);

/// A batch of draws: steps δ, a column each.
struct DrawBatch {
    /// Of every slot.
    slots: Vec<BatchBlock>,
    /// Of the shared parameters.
    shared: SharedBatch,
}

impl EstimateErrors {
    /// Finds the size of patches over which errors go together, and draws the errors that they and
    /// the prior make in the poses; those of the prior alone if the dispersion of single blocks is
    /// the largest. None if the prior leaves a pose free. At the end of the solve: the `factor` of
    /// the normal matrix, the `curvature` κ, and the scores of the `finest` patches.
    ///
    /// # Errors
    /// [`ProblemError`]: a frame that cannot be read, a singular normal matrix.
    pub fn find(
        solution: &Solution,
        (factor, curvature): (&Factor, f64),
        posterior: Option<&Posterior>,
        (of_noise, finest): (&NoiseCovariance, &PatchScores),
        alpha: f64,
    ) -> Result<Option<Self>, ProblemError> {
        let problem = &solution.problem;
        let pattern = problem.pattern();
        let normal = &solution.linearisation.normal;
        let frames = solution.unknowns.frames.len();
        let exposures = ExposurePattern::new(pattern, frames);
        let symbolic = SymbolicFactorisation::new(&exposures.slots);
        let symbolic = symbolic.map_err(|source| problem.factor_error(source))?;
        let equations = exposures.equations(pattern, normal);
        let of_exposures = symbolic.factorise(&equations, 0.0);
        let of_exposures = of_exposures.map_err(|source| problem.factor_error(source))?;
        let of_prior = Pattern::new(pattern.columns(), problem.prior_pairs());
        let (blocks, _) = problem.prior_information(&solution.unknowns, &of_prior);
        let prior = PriorRoot::of(&of_prior, &blocks);
        drop(blocks);
        let Some(prior) = prior else {
            return Ok(None);
        };
        let system = System {
            factor,
            exposures: (&exposures, &of_exposures),
            prior: &prior,
            points: problem.points(),
            slots: pattern.columns(),
            frames,
        };
        let mut doubled: Option<PatchScores> = None;
        let mut finest_dispersion = None;
        let mut largest: Option<(Option<PatchScores>, Patches)> = None;
        for blocks in PATCH_BLOCKS {
            let scores = doubled.as_ref().unwrap_or(finest);
            let dispersion = system.quadratic(scores, curvature) / of_noise.determined;
            finest_dispersion.get_or_insert(dispersion);
            let before = largest.as_ref().map_or(0.0, |l| l.1.dispersion);
            let by_chance = of_noise.pixel_dispersion * chance_factor(scores.len(), alpha);
            let next = scores.doubled();
            if dispersion > before.max(by_chance) {
                largest = Some((doubled.take(), Patches { blocks, dispersion }));
            }
            doubled = Some(next);
        }
        drop(doubled);
        Ok(Some(match largest {
            Some((scores, patches)) => Self {
                draws: system.draw(scores.as_ref().unwrap_or(finest), posterior, curvature),
                patches: Some(patches),
                noise: None,
            },
            None => {
                // Scores of the smallest patches, with the dispersion of single blocks.
                let share = finest_dispersion.map_or(1.0, |c| c / of_noise.pixel_dispersion);
                let scale = if share > 0.0 { share.sqrt() } else { 1.0 };
                let has_shape = pattern.columns() > frames;
                Self {
                    draws: system.draw(&PatchScores::default(), None, curvature),
                    patches: None,
                    noise: has_shape.then(|| system.draw(finest, posterior, curvature * scale)),
                }
            }
        }))
    }

    /// Draws of all errors, by pixels and prior; None if there is no shape and all is noise.
    pub fn of_all(&self) -> Option<&ErrorDraws> {
        match self.patches {
            Some(_) => Some(&self.draws),
            None => self.noise.as_ref(),
        }
    }
}

/// Factor by which the dispersion of some patches exceeds that of blocks by chance, with the
/// probability `alpha` for all sizes of patches: a mean of n squares of normal errors has the
/// relative variance 2/n, and the score of a patch counts as six errors, those of one frame.
fn chance_factor(patches: usize, alpha: f64) -> f64 {
    let z = normal_quantile(alpha, PATCH_BLOCKS.len());
    1.0 + z * (2.0 / (6.0 * patches as f64)).sqrt()
}

impl ErrorDraws {
    /// Number of draws.
    pub fn count(&self) -> usize {
        self.0.len() * BATCH
    }

    /// One draw of the errors of the slots from `first` on.
    pub fn of_slots(&self, first: usize, draw: usize) -> Vec<FrameStep> {
        let slots = self.0[draw / BATCH].slots[first..].iter();
        slots
            .map(|slot| slot.column(draw % BATCH).into_owned())
            .collect()
    }

    /// Covariance of the errors of two slots.
    pub fn of_pair(&self, j: usize, k: usize) -> Block {
        let batches = self.0.iter();
        let sum: Block = batches
            .map(|batch| batch.slots[j] * batch.slots[k].transpose())
            .sum();
        sum / self.count() as f64
    }

    /// Mean square of the errors of a point of the wall, m².
    pub fn mean_square(&self, point: &PointJacobians) -> f64 {
        let square = |batch: &DrawBatch| {
            let of_slots = point.slots.iter();
            let of_slots = of_slots.map(|(slot, jacobian)| jacobian * batch.slots[*slot]);
            let moved = of_slots.fold(point.shared * batch.shared, |sum, moved| sum + moved);
            moved.norm_squared()
        };
        self.0.iter().map(square).sum::<f64>() / self.count() as f64
    }

    /// Covariance of the errors of the shared parameters.
    pub fn of_shared(&self) -> SharedBlock {
        let batches = self.0.iter();
        let sum: SharedBlock = batches
            .map(|batch| batch.shared * batch.shared.transpose())
            .sum();
        sum / self.count() as f64
    }
}

/// Model error in the report.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ModelErrorReport {
    /// Side of the patches of the wall over which residuals err together, metres.
    pub patch_m: f64,
    /// Dispersion of their scores, `c_P`, with all information of the pixels; noise alone has 1 or
    /// less.
    pub dispersion: f64,
}

impl ModelErrorReport {
    /// The report of what was found at the end of a solve.
    pub fn new(found: &Patches, problem: &PhotometricProblem) -> Self {
        Self {
            patch_m: f64::from(found.blocks) * problem.block_size_m(),
            dispersion: found.dispersion * problem.dispersion(),
        }
    }
}

/// The equations of an estimate.
struct System<'s> {
    factor: &'s Factor<'s>,
    /// Exposures, and the factor of their equations for known poses.
    exposures: (&'s ExposurePattern, &'s Factor<'s>),
    prior: &'s PriorRoot,
    /// Measured points, whose noise adds to that of the prior.
    points: Option<&'s PointEquations>,
    /// Number of slots.
    slots: usize,
    /// Number of those that are frames, the first ones.
    frames: usize,
}

/// Right sides or steps of a batch of draws: a column each.
type BatchBlock = SMatrix<f64, FRAME_PARAMETERS, BATCH>;
/// Right sides or steps of the shared parameters.
type SharedBatch = SMatrix<f64, SHARED_PARAMETERS, BATCH>;

impl System<'_> {
    /// Mean of `zᵀ H⁻¹ z − z_eᵀ H_ee⁻¹ z_e` over draws of scores with random signs.
    fn quadratic(&self, scores: &PatchScores, curvature: f64) -> f64 {
        let batches = (0..BATCHES as usize).par_map(|batch| {
            let mut z = vec![BatchBlock::zeros(); self.slots];
            add_signed_scores(scores, curvature, &mut random_of(batch), &mut z);
            let (pattern, factor) = self.exposures;
            let exposures_alone = pattern.rows(&z[..self.frames]);
            let product = |a: &[BatchBlock], b: &[BatchBlock]| -> f64 {
                a.iter().zip(b).map(|(a, b)| a.component_mul(b).sum()).sum()
            };
            product(&z, &self.factor.solve(&z))
                - product(&exposures_alone, &factor.solve(&exposures_alone))
        });
        let draws = (BATCHES as usize * BATCH) as f64;
        batches.into_iter().map(|quadratic| quadratic / draws).sum()
    }

    /// Draws of the steps that scores with random signs and the prior make.
    fn draw(
        &self,
        scores: &PatchScores,
        posterior: Option<&Posterior>,
        curvature: f64,
    ) -> ErrorDraws {
        let batch = |batch: usize| {
            let mut random = random_of(batch);
            let mut z = vec![BatchBlock::zeros(); self.slots];
            let z_shared = add_signed_scores(scores, curvature, &mut random, &mut z);
            self.prior.add_draws(&mut z, &mut random);
            if let Some(points) = self.points {
                points.add_draws(&mut z[self.frames..], &mut random);
            }
            let mut slots = self.factor.solve(&z);
            let shared = posterior.map_or(SharedBatch::zeros(), |posterior| {
                posterior.steps_of_shared(&z, &z_shared)
            });
            if let Some(posterior) = posterior {
                for (step, w) in slots.iter_mut().zip(&posterior.w) {
                    *step -= w * shared;
                }
            }
            DrawBatch { slots, shared }
        };
        ErrorDraws((0..BATCHES as usize).par_map(batch))
    }
}

/// Random numbers of a batch.
fn random_of(batch: usize) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(batch as u64)
}

/// Adds scores with random signs over κ to the right sides of the slots; those of the shared
/// parameters.
fn add_signed_scores(
    scores: &PatchScores,
    curvature: f64,
    random: &mut ChaCha8Rng,
    z: &mut [BatchBlock],
) -> SharedBatch {
    let mut z_shared = SharedBatch::zeros();
    for score in scores.iter() {
        let signs =
            SMatrix::<f64, 1, BATCH>::from_fn(|_, _| if random.random() { 1.0 } else { -1.0 })
                / curvature;
        for (slot, gradient) in &score.slots {
            z[*slot] += gradient * signs;
        }
        z_shared += score.shared * signs;
    }
    z_shared
}

/// Cholesky factor L of the prior's information P, in which a frame has a block with itself and at
/// the most one with the frame before.
struct PriorRoot {
    /// `L_kk`.
    own: Vec<Block>,
    /// `L_k,k−1`; zero for the first.
    before: Vec<Block>,
}

impl PriorRoot {
    /// Factorises P, with the upper `blocks` on `pattern`; None if it is singular.
    fn of(pattern: &Pattern, blocks: &[Block]) -> Option<Self> {
        let block = |row: usize, column: usize| {
            pattern
                .block_index(row, column)
                .map_or_else(Block::zeros, |index| blocks[index])
        };
        let mut root = Self {
            own: Vec::new(),
            before: Vec::new(),
        };
        for k in 0..pattern.columns() {
            let before = match k.checked_sub(1) {
                // L_k,k−1 L_k−1ᵀ = P_k,k−1.
                Some(last) => root.own[last]
                    .solve_lower_triangular(&block(last, k))?
                    .transpose(),
                None => Block::zeros(),
            };
            let left = block(k, k) - before * before.transpose();
            root.own.push(left.cholesky()?.l());
            root.before.push(before);
        }
        Some(root)
    }

    /// Adds draws of a normal vector with the covariance P.
    fn add_draws(&self, z: &mut [BatchBlock], rng: &mut ChaCha8Rng) {
        let mut last = BatchBlock::zeros();
        for ((z, own), before) in z.iter_mut().zip(&self.own).zip(&self.before) {
            let normal = BatchBlock::from_fn(|_, _| StandardNormal.sample(rng));
            *z += own * normal + before * last;
            last = normal;
        }
    }
}
