//! Linearisation of the objective: cost, gradient and normal matrix.

use crate::linear::bordered_system::SharedBorder;
use crate::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::RADIUS_INDEX;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::parameters::shape_functions::ShapeStep;
use crate::parameters::unknowns::Unknowns;
use crate::points::equations::PointEquations;
use crate::problem::block_sums::BlockSums;
use crate::problem::linearisation::{FrameContribution, Linearisation, OtherInformation};
use crate::problem::photometric_problem::PhotometricProblem;
use crate::problem::tile_share::TileShare;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Gauge;

/// Blocks of tiles that are processed before their sums are added: bounds the memory, whatever the
/// tunnel's length.
pub const BATCH: usize = 64;

/// Stiffness of the gauge constraint at the first compared frame over that of its pixels. At about
/// the root of the inverse rounding error, neither rounding moves the frames along the gauge, nor
/// does the condition of the matrix suffer.
const GAUGE_STIFFNESS_RATIO: f64 = 1e6;

impl PhotometricProblem<'_> {
    /// Cost and normal equations at the given estimates of the active frames and the initial values
    /// of all other unknowns.
    ///
    /// # Errors
    /// Those of [`PhotometricProblem::linearise_at`].
    pub fn linearise(&self, active: &[FrameEstimate]) -> Result<Linearisation, ProblemError> {
        self.linearise_at(&self.unknowns_of(active))
    }

    /// Cost and normal equations at the given unknowns.
    ///
    /// The cost is infinite if κ gives no valid camera
    /// ([`crate::parameters::calibration::Calibration::cameras`]). All sums run in the same
    /// order, whatever the number of threads.
    ///
    /// # Errors
    /// [`ProblemError::Frame`] if a frame has to be read again and cannot be.
    pub fn linearise_at(&self, unknowns: &Unknowns) -> Result<Linearisation, ProblemError> {
        let kappa = &unknowns.kappa;
        let mut sums = self.zero_linearisation();
        let calibration = &self.context.calibration;
        let Some(cameras) = calibration.cameras(kappa) else {
            sums.cost = f64::INFINITY;
            return Ok(sums);
        };
        self.visit_blocks(unknowns, &cameras, TileShare::All, &mut |place, block| {
            self.add_block(place, block, &mut sums);
        })?;
        self.complete(unknowns, &mut sums);
        Ok(sums)
    }

    /// Adds to the pixels' part of the equations all other terms and the gauge constraint.
    pub(super) fn complete(&self, unknowns: &Unknowns, sums: &mut Linearisation) {
        self.scale_by_noise(sums);
        self.add_others(unknowns, sums);
        if self.held_frame_count() == 0 {
            let slot = self.gauge_slot.unwrap_or(0);
            let gauge = self.context.gauge();
            let first = &unknowns.frames[slot];
            sums.constraint = self.constrain_gauge(slot, first, &gauge, &mut sums.normal);
        }
    }

    /// Adds all terms but those of the pixels.
    pub(super) fn add_others(&self, unknowns: &Unknowns, sums: &mut Linearisation) {
        let (calibration, kappa) = (&self.context.calibration, &unknowns.kappa);
        sums.cost += self.add_prior(
            unknowns,
            &self.pattern,
            &mut sums.normal,
            sums.border.as_mut(),
        );
        sums.cost += self.add_points(&unknowns.shape, &mut sums.normal);
        if let Some(border) = &mut sums.border {
            sums.cost +=
                calibration.prior_cost(kappa) - self.log_volume_slope() * kappa[RADIUS_INDEX];
            border.gradient[RADIUS_INDEX] -= self.log_volume_slope();
            border.apply_prior(calibration, kappa);
        }
    }

    /// A linearisation without any terms.
    pub fn zero_linearisation(&self) -> Linearisation {
        let border = self
            .estimates_shared
            .then(|| SharedBorder::zeros(self.pattern.columns()));
        Linearisation {
            cost: 0.0,
            normal: NormalEquations::zeros(&self.pattern),
            frames: vec![FrameContribution::default(); self.active.len()],
            border,
            block_gradients: Vec::new(),
            constraint: None,
        }
    }

    /// Adds a block of the wall, with its row and column, to the pixels' part, in units of grey
    /// levels².
    pub(super) fn add_block(&self, place: (i64, i64), block: &BlockSums, sums: &mut Linearisation) {
        block.add_to(&self.pattern, sums);
        sums.block_gradients.push(block.block_gradient(place));
    }

    /// Sums over the given share of the tiles of every block of the wall, and visits them in a
    /// fixed order with row and column of the block.
    pub(super) fn visit_blocks(
        &self,
        unknowns: &Unknowns,
        cameras: &Cameras,
        share: TileShare,
        visit: &mut dyn FnMut((i64, i64), &BlockSums),
    ) -> Result<(), ProblemError> {
        let estimates = &self.with_active(&unknowns.frames);
        let readout_s = self.context.calibration.readout_s(&unknowns.kappa);
        let surface = self.surface_at(unknowns);
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch);
            let pyramids = self.images.load(self.coverage.frames(stretch))?;
            let at_level = cameras.at_level(self.sampling.level);
            let sampled_frames = self.sampled_frames(
                stretch,
                &pyramids,
                estimates,
                &at_level,
                (surface.as_ref(), readout_s),
            );
            for batch in visibility.blocks.chunks(BATCH) {
                let blocks: Vec<BlockSums> = batch.par_map(|block| {
                    let wall = (surface.as_ref(), cameras);
                    self.sum_block((stretch, share), &visibility, block, &sampled_frames, wall)
                });
                for (tiles, block) in batch.iter().zip(&blocks) {
                    visit(visibility.tiles[tiles.start].id.block(), block);
                }
            }
        }
        Ok(())
    }

    /// Multiplies the pixels' part by [`Self::information`].
    pub(super) fn scale_by_noise(&self, sums: &mut Linearisation) {
        let information = self.information();
        sums.cost *= information;
        let NormalEquations { blocks, gradient } = &mut sums.normal;
        blocks.iter_mut().for_each(|b| *b *= information);
        gradient.iter_mut().for_each(|g| *g *= information);
        if let Some(border) = &mut sums.border {
            border.scale(information);
        }
    }

    /// Derivative `3N − 1` of the logarithm of the volume that the pixels leave to the positions,
    /// by `ln r`; 0 if the radius is not estimated.
    ///
    /// Pixels determine the 3N − 1 coordinates of N positions (without the one along the axis) in
    /// units of the radius. In metres, where the prior is a density, they leave a volume that grows
    /// as `r^(3N − 1)`. Without this term the radius would shrink until the steps had no noise.
    pub(super) fn log_volume_slope(&self) -> f64 {
        if self.context.calibration.free[RADIUS_INDEX] {
            (3 * self.compared) as f64 - 1.0
        } else {
            0.0
        }
    }

    /// Normal matrix and border of all that is not pixels, at the given unknowns: the prior, and
    /// measured points.
    pub fn other_information(&self, unknowns: &Unknowns) -> OtherInformation {
        let first = self.active.len();
        let points = self.points.as_deref();
        let of_points = points.into_iter().flat_map(PointEquations::pairs);
        let of_points = of_points.map(|(a, b)| (first + a, first + b));
        let pairs = self.prior_pairs().into_iter().chain(of_points);
        let pattern = Pattern::new(self.pattern.columns(), pairs);
        let (blocks, border) = self.prior_information(unknowns, &pattern);
        let mut normal = NormalEquations {
            blocks,
            gradient: Vec::new(),
        };
        if let Some(points) = points {
            points.add_information(&pattern, first, &mut normal);
        }
        OtherInformation {
            pattern,
            blocks: normal.blocks,
            border,
        }
    }

    /// Pairs of slots that have a common prior.
    pub fn prior_pairs(&self) -> Vec<(usize, usize)> {
        self.context.prior.pairs(&self.active)
    }

    /// Normal matrix, on a pattern that has it, and border of the prior alone, at the given
    /// unknowns.
    pub fn prior_information(
        &self,
        unknowns: &Unknowns,
        pattern: &Pattern,
    ) -> (Vec<Block>, SharedBorder) {
        let mut normal = NormalEquations::zeros(pattern);
        let mut border = SharedBorder::zeros(pattern.columns());
        self.add_prior(unknowns, pattern, &mut normal, Some(&mut border));
        border.apply_prior(&self.context.calibration, &unknowns.kappa);
        (normal.blocks, border)
    }

    /// Adds the prior of poses, exposures and shape to equations on a pattern and returns its cost.
    pub(super) fn add_prior(
        &self,
        unknowns: &Unknowns,
        pattern: &Pattern,
        normal: &mut NormalEquations,
        border: Option<&mut SharedBorder>,
    ) -> f64 {
        let of_frames = self.context.prior.add_to(
            &self.participants,
            &self.with_active(&unknowns.frames),
            &self.active,
            &self.context.calibration.datum(&unknowns.kappa),
            pattern,
            normal,
            border,
        );
        of_frames + self.add_shape_prior(&unknowns.shape, pattern, normal)
    }

    /// Adds the prior of the shape, `½ Σ (c/σ)²`, and returns its cost.
    fn add_shape_prior(
        &self,
        blocks: &[ShapeStep],
        pattern: &Pattern,
        normal: &mut NormalEquations,
    ) -> f64 {
        let Some(shape) = &self.shape else {
            return 0.0;
        };
        let mut cost = 0.0;
        let sigmas_m = shape.model.block_sigmas_m();
        for (k, (block, sigma_m)) in blocks.iter().zip(sigmas_m).enumerate() {
            let (slot, information) = (self.active.len() + k, sigma_m.powi(-2));
            let diagonal = Block::identity() * information;
            normal.add_block(pattern, slot, slot, &diagonal);
            normal.gradient[slot] += block * information;
            cost += 0.5 * information * block.norm_squared();
        }
        cost
    }

    /// Adds the equations of measured points and returns their cost.
    fn add_points(&self, blocks: &[ShapeStep], normal: &mut NormalEquations) -> f64 {
        let first = self.active.len();
        let points = self.points.as_ref();
        points.map_or(0.0, |points| {
            points.add_to(blocks, &self.pattern, first, normal)
        })
    }

    /// Stiffens the first compared frame along the gauge of the given wall, if measured points have
    /// left it free.
    pub fn tie_gauge(&self, frames: &[FrameEstimate], normal: &mut NormalEquations) {
        if self.context.points.is_some() && self.held_frame_count() == 0 {
            let slot = self.gauge_slot.unwrap_or(0);
            let gauge = self.context.planned.gauge();
            self.constrain_gauge(slot, &frames[slot], &gauge, normal);
        }
    }

    /// Stiffens the first compared frame along the gauge, where pixels give no information and
    /// rounding would determine the step.
    ///
    /// Cost and gradient do not change: the position along the gauge follows in closed form from
    /// the prior ([`crate::model::prior::Prior::align_gauge`]). Returns the constraint, with the
    /// index of its block.
    fn constrain_gauge(
        &self,
        slot: usize,
        first: &FrameEstimate,
        gauge: &Gauge,
        normal: &mut NormalEquations,
    ) -> Option<(usize, Block)> {
        let index = self.pattern.block_index(slot, slot)?;
        let pose_block = normal.blocks[index].fixed_view::<6, 6>(0, 0).into_owned();
        let mut constraint = Block::zeros();
        for direction in gauge.directions(&first.pose) {
            let stiffness = (direction.transpose() * pose_block * direction)[0]
                / direction.norm_squared().powi(2);
            let mut of_pose = constraint.fixed_view_mut::<6, 6>(0, 0);
            of_pose += direction * direction.transpose() * (GAUGE_STIFFNESS_RATIO * stiffness);
        }
        normal.blocks[index] += constraint;
        Some((index, constraint))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::calibration::Kappa;
    use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
    use crate::parameters::shape::{Shape, ShapeModel};
    use crate::problem::test_ring::{Ring, number};
    use crate::samples::sampling::Sampling;
    use crate::tiles::interpolation::Interpolation;
    use tunnelstitch_geometry::surface::{Surface, WallPoint};

    /// Central differences of the cost against the gradient, parameter by parameter.
    ///
    /// The texture is eliminated and the loss robust. Where frames agree except for their small
    /// displacements, the fused texture's gradient is each frame's own, so the two agree up to the
    /// errors of sampling (1 to 3 %). (The frames have no noise, so the loss is at its narrowest,
    /// and the residuals must be well inside: at its shoulders S needs more reweighting steps to be
    /// the minimiser.)
    #[test]
    fn gradient_is_the_derivative_of_the_cost() {
        let ring = Ring::new(1e-4);
        check_gradient(&ring, &ring.problem());
        check_gradient(
            &ring,
            &ring.problem_of(Sampling {
                interpolation: Interpolation::Bicubic,
                variance_weighting: true,
                ..ring.sampling()
            }),
        );
    }

    /// In the joint solve the gradient is not exactly the derivative of the pixels' cost (the prior
    /// of the wall contributes), but its change along every parameter is that of the normal
    /// equations.
    #[test]
    fn joint_gradient_changes_as_the_normal_equations_predict() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem_of(ring.joint_sampling());
        let normal = problem.linearise(&ring.estimates).unwrap().normal;
        let steps = [2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 1e-3, 0.1];
        for (parameter, step) in steps.into_iter().enumerate() {
            // The first frame stays, as the equations constrain the gauge there.
            let mut direction: Vec<f64> = (0..ring.estimates.len())
                .map(|k| step * number(k, 20.0 + parameter as f64))
                .collect();
            direction[0] = 0.0;
            let slope = |amount: f64| {
                let moved: Vec<_> = (ring.estimates.iter().zip(&direction))
                    .map(|(estimate, d)| {
                        let mut step = FrameStep::zeros();
                        step[parameter] = amount * d;
                        estimate.retract(&step)
                    })
                    .collect();
                let gradient = problem.linearise(&moved).unwrap().normal.gradient;
                let along = gradient.iter().zip(&direction);
                along.map(|(g, d)| g[parameter] * d).sum::<f64>()
            };
            let change = 0.5 * (slope(1.0) - slope(-1.0));
            let mut predicted = 0.0;
            for i in 0..direction.len() {
                for j in i..direction.len() {
                    if let Some(index) = problem.pattern().block_index(i, j) {
                        let term = normal.blocks[index][(parameter, parameter)];
                        let twice = if i == j { 1.0 } else { 2.0 };
                        predicted += twice * term * direction[i] * direction[j];
                    }
                }
            }
            let ratio = change / predicted;
            assert!(
                (0.9..1.1).contains(&ratio),
                "parameter {parameter}: {ratio}"
            );
        }
    }

    fn check_gradient(ring: &Ring, problem: &PhotometricProblem) {
        let gradient = problem.linearise(&ring.estimates).unwrap().normal.gradient;
        let steps = [2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 1e-3, 0.1];
        for parameter in 0..FRAME_PARAMETERS {
            let (mut error, mut size) = (0.0f64, 0.0f64);
            for frame in 0..ring.estimates.len() {
                let cost = |amount: f64| {
                    let mut step = FrameStep::zeros();
                    step[parameter] = amount;
                    let mut moved = ring.estimates.clone();
                    moved[frame] = moved[frame].retract(&step);
                    problem.linearise(&moved).unwrap().cost
                };
                let h = steps[parameter];
                let numeric = (cost(h) - cost(-h)) / (2.0 * h);
                error += (numeric - gradient[frame][parameter]).powi(2);
                size += numeric.powi(2);
            }
            let relative = (error / size).sqrt();
            assert!(relative < 0.05, "parameter {parameter}: {relative}");
        }
    }

    /// Central differences of the cost against the gradient of the shared parameters.
    #[test]
    fn shared_gradient_is_the_derivative_of_the_cost() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem().with_shared_parameters();
        let mut kappa = Kappa::zeros();
        kappa
            .fixed_rows_mut::<5>(0)
            .copy_from_slice(&[2e-4, 0.02, -0.02, 3e-4, -3e-4]);
        let at = |kappa: &Kappa| {
            let unknowns = Unknowns {
                kappa: *kappa,
                ..problem.unknowns_of(&ring.estimates)
            };
            problem.linearise_at(&unknowns).unwrap()
        };
        let gradient = at(&kappa).border.unwrap().gradient;
        let steps = [2e-4, 0.02, 0.02, 5e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3];
        for (k, h) in steps.into_iter().enumerate() {
            let moved = |amount: f64| {
                let mut kappa = kappa;
                kappa[k] += amount;
                at(&kappa).cost
            };
            let numeric = (moved(h) - moved(-h)) / (2.0 * h);
            let relative = (numeric - gradient[k]).abs() / numeric.abs();
            assert!(
                relative < 0.05,
                "parameter {k}: {numeric} and {}",
                gradient[k]
            );
        }
    }

    /// Central differences of the cost against the gradient of the wall's shape.
    #[test]
    fn shape_gradient_is_the_derivative_of_the_cost() {
        let ring = Ring::new(1e-4);
        let model = ShapeModel::new(
            ring.wall.circle.perimeter_m(),
            WallPoint::default(),
            [-0.5, 2.0],
            16,
            0.01,
        );
        let problem = ring.problem_with_shape(Shape::nominal(model));
        let mut unknowns = problem.unknowns_of(&ring.estimates);
        for (k, block) in unknowns.shape.iter_mut().enumerate() {
            *block = ShapeStep::from_fn(|n, _| 2e-4 * number(8 * k + n, 0.4));
        }
        let gradient = problem.linearise_at(&unknowns).unwrap().normal.gradient;
        let of_shape = &gradient[ring.estimates.len()..];
        let (mut error, mut size) = (0.0f64, 0.0f64);
        let stride = of_shape.len() / 9;
        for block in (0..of_shape.len()).step_by(stride) {
            for component in [0, 3, 6] {
                let cost = |amount: f64| {
                    let mut moved = unknowns.clone();
                    moved.shape[block][component] += amount;
                    problem.linearise_at(&moved).unwrap().cost
                };
                let numeric = (cost(2e-4) - cost(-2e-4)) / 4e-4;
                error += (numeric - of_shape[block][component]).powi(2);
                size += numeric.powi(2);
            }
        }
        let relative = (error / size).sqrt();
        assert!(relative < 0.05, "{relative}");
    }

    /// Undamped steps from 2 mrad and 2 mm off to the truth, up to the gauge.
    #[test]
    fn gauss_newton_steps_converge_to_the_truth() {
        let ring = Ring::new(2e-3);
        assert_steps_converge_to_the_truth(&ring, &ring.problem());
        assert_steps_converge_to_the_truth(&ring, &ring.problem_of(ring.joint_sampling()));
    }

    fn assert_steps_converge_to_the_truth(ring: &Ring, problem: &PhotometricProblem) {
        let mut estimates = ring.estimates.clone();
        let start = problem.linearise(&estimates).unwrap().cost;
        for _ in 0..6 {
            let at = problem.linearise(&estimates).unwrap();
            let factor = problem.symbolic().factorise(&at.normal, 0.0).unwrap();
            let step = factor.step(&at.normal.gradient);
            estimates = estimates
                .iter()
                .zip(&step)
                .map(|(estimate, step)| estimate.retract(step))
                .collect();
        }
        let end = problem.linearise(&estimates).unwrap().cost;
        assert!(end < 0.1 * start, "{start} → {end}");
        let poses: Vec<_> = estimates.iter().map(|e| e.pose).collect();
        let motion = ring.wall.circle.gauge().align(&poses, &ring.wall.poses);
        for (pose, truth) in poses.iter().zip(&ring.wall.poses) {
            let error = truth.local(&motion.apply(pose)).norm();
            assert!(error < 4e-4, "{error}");
        }
    }
}
