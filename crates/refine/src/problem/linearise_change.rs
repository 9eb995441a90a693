//! Update of the equations after a short step, by their change in a share of the tiles.
//!
//! With the sums `L(x) = Σ_t L_t(x)` over all tiles t at the estimate x, and a share S of one in n
//! tiles, spread evenly over the wall, the sums after a step δ to y are
//!
//! `L(y) ≈ L(x) + P δ + n Σ_{t ∈ S} (L_t(y) − L_t(x) − P_t δ)`,
//!
//! with the prediction P of the quadratic model: `H δ` for the gradient, `gᵀδ + ½ δᵀHδ` for the
//! cost, and none for the normal matrix. This has no bias, whatever S. L(x) is known exactly, and
//! so is P δ: only what the model does not predict is estimated from the share, in 2/n of the work.
//!
//! That is mostly noise: samples that move by d pixels have other noise, with the variance
//! `2 (1 − β(d)/β(0))` of its change over that of the noise itself
//! ([`crate::tiles::interpolation::Interpolation::autocorrelation`]). The share takes n times its
//! own part for that of all tiles, so that the next step is off by
//!
//! `√((n − 1) · 2 (1 − β(d)/β(0)))`   σ.
//!
//! The share is the smallest for which this is below [`MAX_ERROR_SIGMA`].
//!
//! Exposures follow the prediction alone. Residuals are linear in bias and gain, so that it is
//! close; and their slow changes along the tunnel are of many σ, as only the prior holds them.
//! Where they change by Δ grey levels together with the texture S, the share would add an error of
//! `√(n − 1) Δ/S` σ.
//!
//! Gradients of single blocks of the wall have no prediction; they are for their scatter.
//!
//! Prior and measured points are computed anew. The stiffness along the gauge stays.
//!
//! Source: R. Y. Rubinstein and D. P. Kroese, "Simulation and the Monte Carlo Method", 2016,
//! section 5.2 (control variates).

use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::{Kappa, SHARED_PARAMETERS};
use crate::parameters::frame_estimate::{EXPOSURE, FRAME_PARAMETERS, FrameStep, POSE};
use crate::parameters::unknowns::Unknowns;
use crate::problem::block_sums::BlockSums;
use crate::problem::linearisation::{BlockGradient, Linearisation};
use crate::problem::photometric_problem::PhotometricProblem;
use crate::problem::tile_share::TileShare;
use crate::tiles::grid::BLOCK;
use crate::tiles::tile_arrays::SAMPLES;
use nalgebra::Vector2;

/// Largest error of the step after an update, σ: it adds half a percent to the error of an
/// estimate.
const MAX_ERROR_SIGMA: f64 = 0.1;
/// Tiles of a share that each frame has at least, so that they stand for all of it.
const MIN_FRAME_TILES: usize = 400;
/// Shares that save work, as sums run twice over them; the smallest has eight tiles of a block.
const SHARES: [usize; 2] = [BLOCK as usize, BLOCK as usize / 2];

/// Sums over some tiles of a block of the wall.
struct BlockPart<'s> {
    /// Row and column of the block.
    place: (i64, i64),
    sums: &'s BlockSums,
}

impl BlockPart<'_> {
    fn gradient(&self) -> BlockGradient {
        self.sums.block_gradient(self.place)
    }
}

impl PhotometricProblem<'_> {
    /// The n of the smallest share, by which the equations `at` an estimate can be updated after a
    /// step that moves the wall by up to `step_px`: with [`MIN_FRAME_TILES`] and an error below
    /// [`MAX_ERROR_SIGMA`]. None if they have to be computed from all tiles: if there is no such
    /// share, or if tiles are not computed one by one.
    pub fn change_share(&self, at: &Linearisation, step_px: f64) -> Option<usize> {
        let beta = |distance_px| self.sampling.interpolation.autocorrelation(distance_px);
        let change = 2.0 * (1.0 - beta(step_px / self.pixel_px()) / beta(0.0));
        let error = |stride: usize| ((stride - 1) as f64 * change).sqrt();
        self.shares(at)
            .find(|stride| error(*stride) < MAX_ERROR_SIGMA)
    }

    /// The n of the smallest share that stands for all tiles, by which a mean over all frames of
    /// the equations' change is computed; None as for [`PhotometricProblem::change_share`].
    pub fn mean_change_share(&self, at: &Linearisation) -> Option<usize> {
        self.shares(at).next()
    }

    /// The n of the shares that save work and have [`MIN_FRAME_TILES`], the smallest share first;
    /// none if tiles are not computed one by one.
    fn shares(&self, at: &Linearisation) -> impl Iterator<Item = usize> {
        let by_tiles = self.wall_model.is_none() && self.assumed_texture.is_none();
        let samples = at.frames.iter().map(|frame| frame.samples);
        let fewest = samples.filter(|samples| *samples > 0).min();
        let fewest = fewest.filter(|_| by_tiles).unwrap_or(0) / SAMPLES;
        let has_enough = move |stride: &usize| fewest >= stride * MIN_FRAME_TILES;
        SHARES.into_iter().filter(has_enough)
    }

    /// Cost and normal equations at the unknowns `to`, from those `at` the unknowns `from` and
    /// their change in one of `stride` tiles.
    ///
    /// # Errors
    /// Those of [`PhotometricProblem::linearise_at`].
    pub fn linearise_change(
        &self,
        at: &Linearisation,
        (from, to): (&Unknowns, &Unknowns),
        stride: usize,
    ) -> Result<Linearisation, ProblemError> {
        let calibration = &self.context.calibration;
        if calibration.cameras(&to.kappa).is_none() {
            return self.linearise_at(to);
        }
        let factor = stride as f64;
        // The pixels' part of the equations.
        let mut next = at.clone();
        if let Some((index, constraint)) = &at.constraint {
            next.normal.blocks[*index] -= constraint;
        }
        next.negate();
        self.add_others(from, &mut next);
        next.negate();
        let (step, shared) = from.local(to);
        let exposures = self.predicted_exposures(&next, (&step, &shared));
        // That which the share does not have.
        self.add_share(from, stride, -factor, &mut next)?;
        self.fix_shared(&mut next);
        let (cost, gradient, shared_gradient) = next.predict(&self.pattern, (&step, &shared));
        next.cost += cost;
        for (sum, change) in next.normal.gradient.iter_mut().zip(&gradient) {
            *sum += change;
        }
        if let Some(border) = &mut next.border {
            border.gradient += shared_gradient;
        }
        self.add_share(to, stride, factor, &mut next)?;
        for (gradient, exposure) in next.normal.gradient.iter_mut().zip(&exposures) {
            gradient
                .fixed_rows_mut::<EXPOSURE>(POSE)
                .copy_from(exposure);
        }
        self.add_others(to, &mut next);
        if let Some((index, constraint)) = &at.constraint {
            next.normal.blocks[*index] += constraint;
        }
        self.fix_shared(&mut next);
        Ok(next)
    }

    /// Gradient by the exposures of the frames after a step, as the equations `at` its beginning
    /// predict it.
    fn predicted_exposures(
        &self,
        at: &Linearisation,
        step: (&[FrameStep], &Kappa),
    ) -> Vec<Vector2<f64>> {
        let (_, change, _) = at.predict(&self.pattern, step);
        let slots = at.normal.gradient.iter().zip(&change);
        slots
            .take(self.active.len())
            .map(|(at, change)| (at + change).fixed_rows::<EXPOSURE>(POSE).into())
            .collect()
    }

    /// Adds `factor` times the pixels' part of one of `stride` tiles, but for the numbers of
    /// samples.
    fn add_share(
        &self,
        unknowns: &Unknowns,
        stride: usize,
        factor: f64,
        sums: &mut Linearisation,
    ) -> Result<(), ProblemError> {
        let of_equations = factor * self.information();
        self.visit_share(unknowns, TileShare::OneIn(stride), &mut |k, part| {
            part.sums.add_equations(&self.pattern, of_equations, sums);
            part.sums.add_contributions(factor, sums);
            sums.block_gradients[k].add(&part.gradient(), factor);
        })
    }

    /// Change of the gradient of the pixels' cost, slot by slot, from the unknowns `from` by a step
    /// δ of all slots to the unknowns `to`; `at`: the equations at the former, which predict the
    /// change `H δ` of the pixels' part. By one of `stride` tiles, if there is a stride.
    ///
    /// # Errors
    /// [`ProblemError::Frame`] if a frame has to be read again and cannot be.
    pub fn pixel_gradient_change(
        &self,
        at: &Linearisation,
        (from, to): (&Unknowns, &Unknowns),
        (step, predicted): (&[FrameStep], &[FrameStep]),
        stride: Option<usize>,
    ) -> Result<Vec<FrameStep>, ProblemError> {
        let information = self.information();
        let add = |change: &mut [FrameStep], part: &BlockPart, sums: &[FrameStep], factor: f64| {
            for (slot, sum) in part.sums.slots.iter().zip(sums) {
                change[*slot] += sum * (factor * information);
            }
        };
        let Some(stride) = stride else {
            let mut others = self.zero_linearisation();
            self.add_others(from, &mut others);
            let before = at.normal.gradient.iter().zip(&others.normal.gradient);
            let mut change: Vec<FrameStep> = before.map(|(all, others)| others - all).collect();
            self.visit_share(to, TileShare::All, &mut |_, part| {
                add(&mut change, &part, &part.sums.gradient, 1.0);
            })?;
            return Ok(change);
        };
        let factor = stride as f64;
        let mut change = predicted.to_vec();
        self.visit_share(from, TileShare::OneIn(stride), &mut |_, part| {
            add(&mut change, &part, &part.sums.gradient, -factor);
            add(&mut change, &part, &part.sums.product(step), -factor);
        })?;
        self.visit_share(to, TileShare::OneIn(stride), &mut |_, part| {
            add(&mut change, &part, &part.sums.gradient, factor);
        })?;
        Ok(change)
    }

    /// Removes the shared parameters from the equations that are not estimated.
    fn fix_shared(&self, sums: &mut Linearisation) {
        let calibration = &self.context.calibration;
        if let Some(border) = &mut sums.border {
            let fixed = (0..SHARED_PARAMETERS).filter(|k| !calibration.has_equations(*k));
            fixed.for_each(|k| border.remove(k));
        }
    }

    /// The gradients of all blocks of the wall at the unknowns `to`; `at`: the equations at the
    /// unknowns `from`, whose own gradients of blocks are taken. A step within
    /// [`MAX_ERROR_SIGMA`] hardly changes their scatter.
    ///
    /// # Errors
    /// [`ProblemError::Frame`] if a frame has to be read again and cannot be.
    pub fn take_block_gradients(
        &self,
        at: &mut Linearisation,
        (from, to): (&Unknowns, &Unknowns),
    ) -> Result<Vec<BlockGradient>, ProblemError> {
        let mut gradients = std::mem::take(&mut at.block_gradients);
        let (step, shared) = from.local(to);
        let unknowns = (FRAME_PARAMETERS * from.frames.len()) as f64;
        if -at.slope(&step, &shared) < MAX_ERROR_SIGMA.powi(2) * unknowns {
            return Ok(gradients);
        }
        let moved = self.wall_step_px(&from.frames, &step, &shared);
        let step_px = moved.into_iter().fold(0.0, f64::max);
        let Some(stride) = self.change_share(at, step_px) else {
            drop(gradients);
            return Ok(self.linearise_at(to)?.block_gradients);
        };
        for (unknowns, factor) in [(from, -1.0), (to, 1.0)] {
            self.visit_share(unknowns, TileShare::OneIn(stride), &mut |k, part| {
                gradients[k].add(&part.gradient(), factor * stride as f64);
            })?;
        }
        Ok(gradients)
    }

    /// Visits a share of the tiles of every block, with the index of the block.
    fn visit_share(
        &self,
        unknowns: &Unknowns,
        share: TileShare,
        visit: &mut dyn FnMut(usize, BlockPart),
    ) -> Result<(), ProblemError> {
        let Some(cameras) = self.context.calibration.cameras(&unknowns.kappa) else {
            return Ok(());
        };
        let mut k = 0;
        self.visit_blocks(unknowns, &cameras, share, &mut |place, sums| {
            visit(k, BlockPart { place, sums });
            k += 1;
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::test_ring::{Ring, number};

    /// Gradient by the poses and cost after a step, by their change in one of four tiles and in all
    /// of them.
    #[test]
    fn change_in_a_share_is_that_in_all_tiles() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem().with_shared_parameters();
        let from = problem.unknowns_of(&ring.estimates);
        let at = problem.linearise_at(&from).unwrap();
        let mut to = from.clone();
        for (k, frame) in to.frames.iter_mut().enumerate() {
            let step = FrameStep::from_fn(|n, _| 2e-4 * number(k, 30.0 + n as f64));
            *frame = frame.retract(&step);
        }
        to.kappa[0] += 1e-4;
        let whole = problem.linearise_at(&to).unwrap();
        for (stride, most) in [(1, 1e-9), (4, 0.1)] {
            let updated = problem.linearise_change(&at, (&from, &to), stride).unwrap();
            let (mut error, mut change) = (0.0, 0.0);
            for k in 0..to.frames.len() {
                let of =
                    |at: &Linearisation| at.normal.gradient[k].fixed_rows::<POSE>(0).into_owned();
                let expected = of(&whole);
                error += (of(&updated) - expected).norm_squared();
                change += (of(&at) - expected).norm_squared();
            }
            let relative = f64::sqrt(error / change);
            assert!(relative < most, "{stride}: {relative}");
            let cost = (updated.cost - whole.cost) / (at.cost - whole.cost);
            assert!(cost.abs() < most, "{stride}: {cost}");
            let scatter = |at: &crate::problem::linearisation::Linearisation| -> f64 {
                let blocks = problem.score_scatter(at).blocks;
                blocks.iter().map(|block| block.norm()).sum()
            };
            let ratio = scatter(&updated) / scatter(&whole);
            assert!((ratio - 1.0).abs() < most, "{stride}: {ratio}");
        }
    }

    /// A step that takes back a common change of all biases, which only the prior holds.
    #[test]
    fn a_share_does_not_move_common_exposures() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem();
        let mut from = problem.unknowns_of(&ring.estimates);
        for frame in &mut from.frames {
            frame.bias += 30.0;
        }
        let at = problem.linearise_at(&from).unwrap();
        let factor = problem.symbolic().factorise(&at.normal, 0.0).unwrap();
        let held = [false; SHARED_PARAMETERS];
        let (step, shared) = at.step(&factor, 0.0, &held).unwrap();
        let to = problem.stepped(&from, &step, &shared);
        let whole = problem.linearise_at(&to).unwrap();
        let updated = problem.linearise_change(&at, (&from, &to), 4).unwrap();
        let moved = |at: &Linearisation| {
            let factor = problem.symbolic().factorise(&at.normal, 0.0).unwrap();
            at.step(&factor, 0.0, &held).unwrap().0
        };
        let (whole, updated) = (moved(&whole), moved(&updated));
        for (whole, updated) in whole.iter().zip(&updated) {
            let bias = updated[7] - whole[7];
            assert!(bias.abs() < 0.4, "{bias}");
        }
    }
}
