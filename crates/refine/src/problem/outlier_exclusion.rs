//! Exclusion of the observations that do not show the wall, before a solve.

use crate::model::context::FrameWindow;
use crate::model::problem_error::ProblemError;
use crate::problem::linearise::BATCH;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::excluded_tiles::ExcludedTiles;
use crate::samples::observer_marks::ObserverMarks;
use crate::samples::outlier_mask::OutlierMask;
use crate::samples::sampling::Sampling;
use crate::samples::visibility::Visibility;
use std::borrow::Cow;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

impl PhotometricProblem<'_> {
    /// Excludes the observations that do not show the wall ([`OutlierMask`]), detected in the tiles
    /// of the problem, or, if a `density` is given, in those of another lattice over all of the
    /// wall.
    ///
    /// In its own tiles, the problem is linearised at the initial estimates as well, from the same
    /// samples.
    ///
    /// # Errors
    /// [`ProblemError`].
    pub fn exclude_outliers(mut self, density: Option<f64>) -> Result<Self, ProblemError> {
        let Some(density) = density else {
            self.exclude_own_outliers()?;
            return Ok(self);
        };
        let sampling = Sampling {
            density,
            joint: false,
            ..self.sampling
        };
        let window = FrameWindow {
            participants: self.participants.clone(),
            active: self.active.clone(),
            estimates: &self.estimates,
            compared: Cow::Owned(self.coverage.compared()),
        };
        let other = Self::new(&self.context, sampling, window)?;
        let mut mask = other.empty_outlier_mask()?;
        for stretch in 0..other.coverage.len() {
            let visibility = other.coverage.visibility(stretch);
            other.detect_outliers(stretch, &visibility, &mut mask)?;
        }
        let mut excluded = Vec::new();
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch);
            let participants = self.coverage.frames(stretch);
            let marks = mask.mark(&visibility, &self.grid, participants);
            self.excluded_tiles.add(&visibility, &marks);
            excluded.push(marks);
        }
        self.coverage.exclude(excluded);
        Ok(self)
    }

    /// Excludes the outliers in the problem's own tiles, and linearises it without them.
    fn exclude_own_outliers(&mut self) -> Result<(), ProblemError> {
        let mask = self.empty_outlier_mask()?;
        let unknowns = self.initial_unknowns();
        // The initial estimates are feasible.
        let Some(cameras) = self.context.calibration.cameras(&unknowns.kappa) else {
            return Ok(());
        };
        let readout_s = self.context.calibration.readout_s(&unknowns.kappa);
        let surface = self.surface_at(&unknowns);
        let mut sums = self.zero_linearisation();
        let (mut excluded, mut excluded_tiles) = (Vec::new(), ExcludedTiles::default());
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch);
            let pyramids = self.images.load(self.coverage.frames(stretch))?;
            let at_level = cameras.at_level(self.sampling.level);
            let wall = (surface.as_ref(), readout_s);
            let sampled_frames =
                self.sampled_frames(stretch, &pyramids, &self.estimates, &at_level, wall);
            let mut marks = ObserverMarks::none(visibility.observers.len());
            for batch in visibility.blocks.chunks(BATCH) {
                let blocks = batch.par_map(|block| {
                    let wall = (surface.as_ref(), &cameras);
                    self.sum_inliers((stretch, &mask), &visibility, block, &sampled_frames, wall)
                });
                for (tiles, (is_outlier, block)) in batch.iter().zip(&blocks) {
                    let place = visibility.tiles[tiles.start].id.block();
                    let observers = visibility.tiles[tiles.clone()].iter();
                    let observers = observers.flat_map(|tile| tile.observers.clone());
                    let outliers = observers.zip(is_outlier).filter(|(_, is)| **is);
                    outliers.for_each(|(observer, _)| marks.set(observer));
                    if let Some(block) = block {
                        self.add_block(place, block, &mut sums);
                    }
                }
            }
            excluded_tiles.add(&visibility, &marks);
            excluded.push(marks);
        }
        self.complete(&unknowns, &mut sums);
        self.initial = Some(sums);
        self.excluded_tiles = excluded_tiles;
        self.coverage.exclude(excluded);
        Ok(())
    }

    /// Adds the outliers of a stretch to a mask.
    fn detect_outliers(
        &self,
        stretch: usize,
        visibility: &Visibility,
        mask: &mut OutlierMask,
    ) -> Result<(), ProblemError> {
        let participants = self.coverage.frames(stretch);
        let pyramids = self.images.load(participants)?;
        let sampled_frames = self.initial_sampled_frames(stretch, &pyramids);
        mask.detect(
            self.context.surface.as_ref(),
            visibility,
            participants,
            &sampled_frames,
            &self.noise,
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::problem::test_ring::Ring;
    use tunnelstitch_core::frames::{FrameCache, GreyImage, Pyramid};

    /// A dark spot in one frame: its tiles are excluded, and the equations that come with the
    /// exclusion are those of the problem without them, to the byte.
    #[test]
    fn problem_is_linearised_without_its_outliers() {
        let mut ring = Ring::new(1e-4);
        let with_spot = |(k, frame): (usize, GreyImage)| {
            let (w, h) = (frame.width(), frame.height());
            let is_spot = |n: usize| k == 5 && (n % w).abs_diff(w / 2) + n / w < 30;
            let values = frame.data().iter().enumerate();
            let data = values.map(|(n, value)| if is_spot(n) { 10.0 } else { *value });
            Pyramid::new(GreyImage::new(w, h, data.collect()), 1)
        };
        let frames = ring.wall.frames().into_iter().enumerate();
        ring.frames = FrameCache::of_pyramids(frames.map(with_spot));
        let whole = ring.problem().linearise(&ring.estimates).unwrap();
        let mut problem = ring.problem().exclude_outliers(None).unwrap();
        let at = problem.take_initial_linearisation().unwrap();
        let expected = problem.linearise(&ring.estimates).unwrap();
        assert!(at.frames[5].samples < whole.frames[5].samples);
        assert_eq!(at.cost, expected.cost);
        assert_eq!(at.normal.gradient, expected.normal.gradient);
        assert_eq!(at.normal.blocks, expected.normal.blocks);
        let scatter = |at| problem.score_scatter(at).blocks;
        assert_eq!(scatter(&at), scatter(&expected));
        assert_eq!(at.block_gradients.len(), expected.block_gradients.len());
    }
}
