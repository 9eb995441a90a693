//! A look at the samples before a solve: the noise, and what is not wall.

use crate::frames::noise_at_level;
use crate::numerics::simd_dispatch::wide;
use crate::refine::joint::joint_block::{JointBlock, WallModel};
use crate::refine::joint::stiffness::Probe;
use crate::refine::model::context::FrameWindow;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::problem::photometric_problem::PhotometricProblem;
use crate::refine::samples::outlier_mask::OutlierMask;
use crate::refine::samples::sampling::Sampling;
use crate::refine::samples::visibility::{Observer, Tile, Visibility};
use crate::refine::tiles::denoising::TextureSpectrum;
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::{BLOCK, TilePoints};
use crate::refine::tiles::interpolation::Interpolation;
use crate::refine::tiles::residual_weighting::NoiseHistogram;
use crate::refine::tiles::tile::{Misfit, TileObservation, TileWorkspace};
use crate::super_resolve::{Evidence, aliased_variance};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Tiles looked at to estimate the noise.
const SCALE_TILES: usize = 600;
/// Blocks of tiles that are solved for to learn what the wall is like.
const LEARNED_BLOCKS: usize = 48;
/// What detail finer than pixels adds to the variance of what they read, over the variance of their
/// noise, at the least, for the wall to be solved for: less than a fortieth of the error is at
/// stake below. On bricks of 30 × 10 pixels it is 1.1, 0.35 and 0.13 with noise of 1, 2 and 4 grey
/// levels, on concrete 0.02 with 2.
const LEAST_ALIASED: f64 = 0.05;
/// Factor by which the variance of residuals may be short of the sensor's.
const MOST_UNDERESTIMATE: f64 = 1.25;

impl PhotometricProblem<'_> {
    /// Reads the noise from the residuals around the plain mean in every few tiles, and what is
    /// typical of the texture.
    pub(super) fn estimate_noise(&mut self) -> Result<(), ProblemError> {
        let counted = self.gather_from_tiles(
            SCALE_TILES,
            |(histogram, spectrum): &mut (NoiseHistogram, TextureSpectrum), look| {
                wide(
                    #[inline(always)]
                    || {
                        look.work
                            .count_residuals(look.points, look.seen(), histogram, spectrum)
                    },
                );
            },
        )?;
        let (mut histogram, mut spectrum) = (NoiseHistogram::default(), TextureSpectrum::default());
        for (counted, seen) in &counted {
            histogram = histogram.merge(counted);
            spectrum = spectrum.merge(seen);
        }
        self.noise = histogram.fit();
        // Residuals are a little too small, for S has fitted itself to them; single pictures know
        // the noise better, but take fine texture for noise.
        let interpolation = self.sampling.interpolation;
        let axis = interpolation.autocorrelation(0.0);
        let single = self.scene.noise.powi(2)
            * match interpolation {
                Interpolation::Bilinear => noise_at_level(self.sampling.level),
                // At full size only.
                Interpolation::Bicubic => axis * axis,
            };
        let fitted = f64::from(self.noise.floor);
        if single > fitted && single < MOST_UNDERESTIMATE * fitted {
            self.noise.floor = single as f32;
        }
        // Before the frames are aligned at full size, residuals are mostly misalignment.
        if self.sampling.level == 0 && self.active.len() > 1 {
            let floor = f64::from(self.noise.floor);
            self.denoiser = Some(spectrum.denoiser(floor, interpolation));
        }
        // A sample's variance is that of a pixel times the square of an axis's share.
        self.sigma = f64::from(self.noise.floor).sqrt() / axis;
        Ok(())
    }

    /// Learns how rough the wall is, and how stiffly it holds frames, from blocks spread over all
    /// of it; `None` if it is so smooth that there is nothing between the pixels to be solved for.
    pub(super) fn learn_wall(&self) -> Result<Option<WallModel>, ProblemError> {
        let found = self.at_blocks(|block| block.evidence())?;
        let strengths = found
            .iter()
            .fold(Evidence::default(), Evidence::merge)
            .strengths();
        let aliased = aliased_variance(&strengths, self.grid.density);
        if aliased < LEAST_ALIASED * self.sigma.powi(2) {
            return Ok(None);
        }
        let found = self.at_blocks(|block| block.stiffness(strengths))?;
        let stiffness = found
            .iter()
            .fold(Probe::default(), Probe::merge)
            .stiffness();
        Ok(Some(WallModel {
            strengths,
            stiffness,
        }))
    }

    /// Works on about [`LEARNED_BLOCKS`] blocks spread over all of the wall.
    fn at_blocks<T: Send>(
        &self,
        work: impl Fn(JointBlock) -> T + Sync,
    ) -> Result<Vec<T>, ProblemError> {
        let blocks = self.coverage.tiles / (BLOCK * BLOCK) as usize;
        let stride = (blocks / LEARNED_BLOCKS).max(1);
        let mut found = Vec::new();
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch)?;
            let pictures = self.pictures.of(self.coverage.frames(stretch))?;
            let views = self.held_views(stretch, &pictures);
            let blocks: Vec<&Range<usize>> = visibility.blocks.iter().step_by(stride).collect();
            let work = |block| work(self.joint(&visibility, block, &views));
            found.extend(blocks.into_par_iter().map(work).collect::<Vec<T>>());
        }
        Ok(found)
    }

    /// A block of the wall, to be solved for jointly with the poses.
    pub(super) fn joint<'v>(
        &self,
        visibility: &'v Visibility,
        block: &Range<usize>,
        views: &'v [SampledFrame<'v>],
    ) -> JointBlock<'v> {
        JointBlock::new(
            &self.scene,
            &self.grid,
            visibility,
            block,
            views,
            self.sigma,
        )
    }

    /// Leaves out what is in a frame but not on the wall, as its own tiles show it or, if a
    /// `density` is given, those of another lattice over all of the wall.
    ///
    /// # Errors
    /// [`ProblemError`].
    pub fn exclude_outliers(mut self, density: Option<f64>) -> Result<Self, ProblemError> {
        let mut foreign = match density {
            None => self.no_foreign()?,
            Some(density) => {
                let sampling = Sampling {
                    density,
                    information: 1.0,
                    joint: false,
                    ..self.sampling
                };
                let members = FrameWindow {
                    participants: self.participants.clone(),
                    active: self.active.clone(),
                    estimates: &self.held,
                    compared: Cow::Owned(self.coverage.compared()),
                };
                let other = Self::new(&self.scene, sampling, members)?;
                let mut foreign = other.no_foreign()?;
                for stretch in 0..other.coverage.len() {
                    let visibility = other.coverage.visibility(stretch)?;
                    other.find_foreign(stretch, &visibility, &mut foreign)?;
                }
                foreign
            }
        };
        let mut left_out = Vec::new();
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch)?;
            if density.is_none() {
                foreign.forget();
                self.find_foreign(stretch, &visibility, &mut foreign)?;
            }
            let frames = self.coverage.frames(stretch);
            left_out.push(foreign.among(&visibility, &self.grid, frames));
        }
        self.coverage.leave_out(left_out);
        Ok(self)
    }

    /// Nothing found yet, and what misfit is usual.
    fn no_foreign(&self) -> Result<OutlierMask, ProblemError> {
        let found = self.gather_from_tiles(SCALE_TILES, |misfits: &mut Vec<Misfit>, look| {
            wide(
                #[inline(always)]
                || look.work.misfit(look.points, look.seen(), &self.noise),
            );
            misfits.append(&mut look.work.misfits);
        })?;
        Ok(OutlierMask::new(self.grid, found.concat()))
    }

    /// Adds what is in a frame but not on the wall in a stretch.
    fn find_foreign(
        &self,
        stretch: usize,
        visibility: &Visibility,
        foreign: &mut OutlierMask,
    ) -> Result<(), ProblemError> {
        let frames = self.coverage.frames(stretch);
        let pictures = self.pictures.of(frames)?;
        let views = self.held_views(stretch, &pictures);
        foreign.look(self.scene.surface, visibility, frames, &views, &self.noise);
        Ok(())
    }

    /// Works on about `count` tiles spread over all of the wall, or all tiles if there are fewer,
    /// with the estimates the problem was made with; returns what each run of tiles has gathered,
    /// always in the same order.
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn gather_from_tiles<T: Default + Send>(
        &self,
        count: usize,
        work: impl Fn(&mut T, &mut ObservedTile) + Sync,
    ) -> Result<Vec<T>, ProblemError> {
        let stride = (self.coverage.tiles / count).max(1);
        let mut gathered = Vec::new();
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch)?;
            let frames = self.coverage.frames(stretch);
            let pictures = self.pictures.of(frames)?;
            let views = self.held_views(stretch, &pictures);
            let tiles: Vec<&Tile> = visibility.tiles.iter().step_by(stride).collect();
            let runs = tiles.par_chunks(32).map(|tiles| {
                let mut gathered = T::default();
                let mut tile_work = TileWorkspace::default();
                let mut scratch = Vec::new();
                for tile in tiles {
                    let points =
                        TilePoints::new(&self.grid, self.scene.surface, tile.id, &mut scratch);
                    let mut look = ObservedTile {
                        work: &mut tile_work,
                        points: &points,
                        observers: visibility.observers(tile),
                        views: &views,
                        frames,
                    };
                    work(&mut gathered, &mut look);
                }
                gathered
            });
            gathered.extend(runs.collect::<Vec<T>>());
        }
        Ok(gathered)
    }
}

/// A tile and those who see it.
pub struct ObservedTile<'l> {
    /// Room to work in.
    pub work: &'l mut TileWorkspace,
    /// The tile's samples.
    pub points: &'l TilePoints,
    /// The frames that see it.
    pub observers: &'l [Observer],
    /// The frames of the stretch, and which participants they are.
    pub views: &'l [SampledFrame<'l>],
    /// See `views`.
    pub frames: &'l [usize],
}

impl<'l> ObservedTile<'l> {
    /// The observers as the tile's work wants them.
    #[inline(always)]
    pub fn seen(&self) -> impl Iterator<Item = TileObservation<'l>> + use<'l> {
        let views = self.views;
        self.observers.iter().map(move |o| o.seen(views))
    }
}
