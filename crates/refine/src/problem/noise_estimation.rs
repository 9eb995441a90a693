//! Estimates from the samples before a solve: noise, model of the wall, and typical misfits.

use crate::joint::joint_block::{JointBlock, WallModel};
use crate::joint::stiffness::StiffnessSums;
use crate::model::problem_error::ProblemError;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::observer::Observer;
use crate::samples::outlier_mask::OutlierMask;
use crate::samples::visibility::{Tile, Visibility};
use crate::thresholds::photometric_problem::MAX_NOISE_UNDERESTIMATE;
use crate::tiles::denoising::TextureSpectrum;
use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::grid::{BLOCK, TilePoints};
use crate::tiles::interpolation::Interpolation;
use crate::tiles::residual_weighting::NoiseHistogram;
use crate::tiles::workspace::{Misfit, TileObservation, TileWorkspace};
use rayon::prelude::*;
use std::ops::Range;
use tunnelstitch_core::frames::noise_at_level;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_super_resolve::{RoughnessEvidence, aliased_variance};

/// Least variance that detail finer than pixels adds to a pixel, over the variance of its noise,
/// for the wall to be solved for jointly: below it, less than a fortieth of the error is at stake.
/// On bricks of 30 × 10 pixels the ratio is 1.1, 0.35 and 0.13 with noise of 1, 2 and 4 grey
/// levels, on concrete 0.02 with 2.
const MIN_ALIASED_VARIANCE_RATIO: f64 = 0.05;
/// Tiles of one piece of parallel work.
const TILES_PER_TASK: usize = 32;
/// Number of tiles from which the noise and the typical misfit are estimated: tens of thousands of
/// residuals.
const NOISE_ESTIMATION_TILES: usize = 2400;
/// Number of blocks of tiles that are solved for to estimate roughness and stiffness of the wall:
/// some thousand tiles.
const WALL_MODEL_BLOCKS: usize = 48;

impl PhotometricProblem<'_> {
    /// Estimates the noise model and the spectrum of the texture from the residuals around the
    /// plain mean in some tiles spread over the wall.
    pub(super) fn estimate_noise(&mut self) -> Result<(), ProblemError> {
        // Before that, the residuals of coarser levels are mostly misalignment.
        let is_aligned = self.sampling.level == 0 || self.sampling.variance_weighting;
        let has_denoiser = is_aligned && self.active.len() > 1;
        let counted = self.gather_from_tiles(
            NOISE_ESTIMATION_TILES,
            |(histogram, spectrum): &mut (NoiseHistogram, Option<TextureSpectrum>), tile| {
                dispatch_simd(
                    #[inline(always)]
                    || {
                        let observations = tile.observations();
                        let spectrum = has_denoiser.then(|| spectrum.get_or_insert_default());
                        tile.workspace.count_residuals(
                            tile.points,
                            observations,
                            histogram,
                            spectrum,
                        );
                    },
                );
            },
        )?;
        let (mut histogram, mut spectrum) = (NoiseHistogram::default(), None);
        for (residuals, textures) in counted {
            histogram = histogram.merge(&residuals);
            let both = spectrum.into_iter().chain(textures);
            spectrum = both.reduce(TextureSpectrum::merge);
        }
        self.noise = histogram.fit();
        // The residuals are a little too small, as S is fitted to them. Single images give a better
        // estimate, but mistake fine texture for noise.
        let interpolation = self.sampling.interpolation;
        let axis = interpolation.autocorrelation(0.0);
        let single = self.context.noise.variance_at(self.sampling.level)
            * match interpolation {
                Interpolation::Bilinear => 1.0,
                // Neighbours of coarser levels are taken to go together in either interpolation.
                Interpolation::Bicubic => axis * axis / noise_at_level(0),
            };
        let fitted = f64::from(self.noise.floor);
        if single > fitted && single < MAX_NOISE_UNDERESTIMATE * fitted {
            self.noise.floor = single as f32;
        }
        self.denoiser = spectrum.as_ref().map(TextureSpectrum::denoiser);
        // The variance of a sample is that of a pixel times `β(0)²`.
        self.sigma = f64::from(self.noise.floor).sqrt() / axis;
        self.unit_variance = if self.sampling.variance_weighting || self.sampling.joint {
            self.sigma.powi(2)
        } else {
            histogram.unit_variance(&self.noise) / (axis * axis)
        };
        Ok(())
    }

    /// Estimates roughness and stiffness of the wall from blocks spread over all of it; None if it
    /// has too little detail finer than pixels ([`MIN_ALIASED_VARIANCE_RATIO`]).
    pub(super) fn estimate_wall_model(&self) -> Result<Option<WallModel>, ProblemError> {
        let evidence = self.map_blocks(|block| block.evidence())?;
        let strengths = evidence
            .iter()
            .fold(RoughnessEvidence::default(), RoughnessEvidence::merge)
            .strengths();
        let aliased = aliased_variance(&strengths, self.grid.density);
        if aliased < MIN_ALIASED_VARIANCE_RATIO * self.sigma.powi(2) {
            return Ok(None);
        }
        let sums = self.map_blocks(|block| block.stiffness_sums(strengths))?;
        let stiffness = sums
            .iter()
            .fold(StiffnessSums::default(), StiffnessSums::merge)
            .stiffness();
        Ok(Some(WallModel {
            strengths,
            stiffness,
        }))
    }

    /// Applies `work` to about [`WALL_MODEL_BLOCKS`] blocks spread over all of the wall.
    fn map_blocks<T: Send>(
        &self,
        work: impl Fn(JointBlock) -> T + Sync,
    ) -> Result<Vec<T>, ProblemError> {
        let blocks = self.coverage.tiles / (BLOCK * BLOCK) as usize;
        let stride = (blocks / WALL_MODEL_BLOCKS).max(1);
        let mut results = Vec::new();
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch);
            let pyramids = self.images.load(self.coverage.frames(stretch))?;
            let sampled_frames = self.initial_sampled_frames(stretch, &pyramids);
            let blocks: Vec<&Range<usize>> = visibility.blocks.iter().step_by(stride).collect();
            let work =
                |block: &&Range<usize>| work(self.joint_block(&visibility, block, &sampled_frames));
            results.extend(blocks.par_map(work));
        }
        Ok(results)
    }

    /// A block of the wall, to be solved for jointly with the poses.
    pub(super) fn joint_block<'v>(
        &self,
        visibility: &'v Visibility,
        block: &Range<usize>,
        sampled_frames: &'v [SampledFrame<'v>],
    ) -> JointBlock<'v> {
        JointBlock::new(
            &self.context,
            &self.grid,
            visibility,
            block,
            sampled_frames,
            self.sigma,
        )
    }

    /// An outlier mask without outliers, with the typical misfits of the wall.
    pub(super) fn empty_outlier_mask(&self) -> Result<OutlierMask, ProblemError> {
        let gather = |misfits: &mut Vec<Misfit>, tile: &mut ObservedTile| {
            dispatch_simd(
                #[inline(always)]
                || {
                    let observations = tile.observations();
                    tile.workspace
                        .compute_misfits(tile.points, observations, &self.noise);
                },
            );
            misfits.append(&mut tile.workspace.misfits);
        };
        let misfits = self.gather_from_tiles(NOISE_ESTIMATION_TILES, gather)?;
        Ok(OutlierMask::new(self.grid, misfits.concat()))
    }

    /// Applies `work` to about `count` tiles spread over all of the wall, or to all tiles if there
    /// are fewer, at the initial estimates. Returns the results of all chunks of tiles, always in
    /// the same order.
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn gather_from_tiles<T: Default + Send>(
        &self,
        count: usize,
        work: impl Fn(&mut T, &mut ObservedTile) + Sync,
    ) -> Result<Vec<T>, ProblemError> {
        let mut gathered = Vec::new();
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch);
            let participants = self.coverage.frames(stretch);
            let pyramids = self.images.load(participants)?;
            let sampled_frames = self.initial_sampled_frames(stretch, &pyramids);
            let tiles = self.some_tiles(&visibility, count);
            let chunks = tiles.par_chunks(TILES_PER_TASK).map(|tiles| {
                let mut gathered = T::default();
                let mut workspace = TileWorkspace::default();
                let mut scratch = Vec::new();
                for tile in tiles {
                    let points = TilePoints::new(
                        &self.grid,
                        self.context.surface.as_ref(),
                        tile.id,
                        &mut scratch,
                    );
                    let mut observed_tile = ObservedTile {
                        workspace: &mut workspace,
                        points: &points,
                        observers: visibility.observers(tile),
                        sampled_frames: &sampled_frames,
                        participants,
                    };
                    work(&mut gathered, &mut observed_tile);
                }
                gathered
            });
            gathered.extend(chunks.collect::<Vec<T>>());
        }
        Ok(gathered)
    }

    /// About `count` of all tiles, those of a stretch.
    ///
    /// In the last solves they are chosen by their places, `count` to twice as many: problems on
    /// the same lattice have the same ones, and so the same noise and the same typical misfits,
    /// even if some other tiles are observed.
    fn some_tiles<'v>(&self, visibility: &'v Visibility, count: usize) -> Vec<&'v Tile> {
        let stride = (self.coverage.tiles / count).max(1);
        let tiles = visibility.tiles.iter();
        match self.sampling.variance_weighting {
            true => {
                let stride = previous_power_of_two(stride);
                tiles.filter(|tile| tile.id.is_one_in(stride)).collect()
            }
            false => tiles.step_by(stride).collect(),
        }
    }
}

/// The largest power of two up to a number of 1 or more.
fn previous_power_of_two(number: usize) -> usize {
    1 << number.ilog2()
}

/// A tile with its observers.
pub struct ObservedTile<'t> {
    /// Reusable memory.
    pub workspace: &'t mut TileWorkspace,
    /// The tile's samples.
    pub points: &'t TilePoints,
    /// The frames that observe it.
    pub observers: &'t [Observer],
    /// The frames of the stretch.
    pub sampled_frames: &'t [SampledFrame<'t>],
    /// Indices of these frames among the participants.
    pub participants: &'t [usize],
}

impl<'t> ObservedTile<'t> {
    /// Observations for the work on the tile.
    #[inline(always)]
    pub fn observations(&self) -> impl Iterator<Item = TileObservation<'t>> + use<'t> {
        let sampled_frames = self.sampled_frames;
        self.observers
            .iter()
            .map(move |o| o.observation(sampled_frames))
    }
}
