//! Outlier mask: tiles in which a frame shows something else than the wall, such as glints, moved
//! objects or smears.
//!
//! The robust loss rejects single samples. It does not reject the flanks of a glint: a few grey
//! levels too bright over some pixels, they pass for noise, yet they move with the camera, and on a
//! faint wall they are as steep as its texture. All samples of a tile together separate them from
//! noise. For each observer of a tile the misfit is
//!
//! `R = Σ_x v (ρ(e)/v) / Σ_x v`,   e: residual from the robust mean that starts at the median.
//!
//! R is about ½ whatever the texture, if the frame shows the wall. Median and spread of R are
//! estimated from the survey itself, in classes of the mean variance v. A frame is excluded from a
//! tile where R exceeds the median by [`MIN_OUTLIER_EXCESS`] spreads, or where the sum of the
//! excesses of the tile and its neighbours does, `Σz/√n`.
//!
//! The mask is computed once before a solve: the observations stay constant while the poses move.

use crate::samples::observer_marks::ObserverMarks;
use crate::samples::visibility::{Tile, Visibility};
use crate::thresholds::outlier_mask::MIN_MISFIT_SPREAD;
use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::grid::{BLOCK, TileId, TilePoints, WallGrid};
use crate::tiles::residual_weighting::{NoiseModel, median_and_sigma};
use crate::tiles::workspace::{Misfit, TileWorkspace};
use std::collections::HashMap;
use std::ops::Range;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::surface::Surface;

/// Excess of a misfit over the typical one, in spreads, from which a frame does not show the wall.
/// Normal deviates exceed it three times in ten million; a survey has about as many observations.
const MIN_OUTLIER_EXCESS: f32 = 5.0;

/// Largest excess of a tile, in spreads, that counts in the test of its neighbourhood: `√9` of
/// [`MIN_OUTLIER_EXCESS`], so that a single bad tile of nine does not exclude its neighbours.
const MAX_NEIGHBOUR_EXCESS: f32 = 3.0 * MIN_OUTLIER_EXCESS;

/// Number of classes of the mean variance, with equally many tiles each.
const CLASSES: usize = 8;

/// Median and spread of the misfits of a survey.
#[derive(Clone, Debug)]
struct TypicalMisfit {
    /// Upper limit of a class of the mean variance, median of R and its spread.
    classes: Vec<(f32, f32, f32)>,
}

impl TypicalMisfit {
    /// Estimates median and spread from the misfits of some tiles.
    fn new(mut misfits: Vec<Misfit>) -> Self {
        misfits.sort_unstable_by(|a, b| a.mean_variance.total_cmp(&b.mean_variance));
        let size = misfits.len().div_ceil(CLASSES).max(1);
        let classes = misfits.chunks(size).map(|class| {
            let mut values: Vec<f32> = class.iter().map(|m| m.loss).collect();
            let (median, sigma) = median_and_sigma(&mut values);
            let last = class.last().map_or(0.0, |m| m.mean_variance);
            (last, median, sigma.max(MIN_MISFIT_SPREAD))
        });
        Self {
            classes: classes.collect(),
        }
    }

    /// Excess of a misfit over the median, in spreads.
    fn excess(&self, misfit: &Misfit) -> f32 {
        let class = self
            .classes
            .iter()
            .find(|(last, _, _)| misfit.mean_variance <= *last)
            .or(self.classes.last());
        class.map_or(0.0, |(_, median, spread)| (misfit.loss - median) / spread)
    }
}

/// The tiles in which participants show something else than the wall.
#[derive(Clone, Debug)]
pub struct OutlierMask {
    grid: WallGrid,
    typical: TypicalMisfit,
    /// Outlying participants, ascending, tile by tile.
    tiles: HashMap<TileId, Vec<usize>>,
}

impl OutlierMask {
    /// An empty mask; `misfits` of some tiles of `grid` are the reference.
    pub fn new(grid: WallGrid, misfits: Vec<Misfit>) -> Self {
        Self {
            grid,
            typical: TypicalMisfit::new(misfits),
            tiles: HashMap::new(),
        }
    }

    /// Removes all outliers; the reference stays.
    pub fn clear(&mut self) {
        self.tiles.clear();
    }

    /// Adds the outliers of all tiles of a stretch; `participants` are the indices of its
    /// `sampled_frames`.
    pub fn detect(
        &mut self,
        surface: &dyn Surface,
        visibility: &Visibility,
        participants: &[usize],
        sampled_frames: &[SampledFrame],
        noise: &NoiseModel,
    ) {
        let outliers = visibility.blocks.par_map(|block| {
            let tiles = &visibility.tiles[block.clone()];
            let mut workspace = TileWorkspace::default();
            let mut scratch = Vec::new();
            let mut misfits = Vec::new();
            for tile in tiles {
                let points = TilePoints::new(&self.grid, surface, tile.id, &mut scratch);
                let observers = visibility.observers(tile);
                dispatch_simd(
                    #[inline(always)]
                    || {
                        let observations = observers.iter().map(|o| o.observation(sampled_frames));
                        workspace.compute_misfits(&points, observations, noise);
                    },
                );
                misfits.append(&mut workspace.misfits);
            }
            let mut is_outlier = self.find_outliers(visibility, block, &misfits).into_iter();
            let mut outliers = Vec::new();
            for tile in tiles {
                let observers = visibility.observers(tile).iter().zip(&mut is_outlier);
                let outlying = observers.filter(|(_, is_outlier)| *is_outlier);
                let outlying = outlying.map(|(observer, _)| participants[observer.frame as usize]);
                let outlying: Vec<usize> = outlying.collect();
                if !outlying.is_empty() {
                    outliers.push((tile.id, outlying));
                }
            }
            outliers
        });
        self.tiles.extend(outliers.concat());
    }

    /// True for the outliers among the observers of a block, tile by tile; `misfits` are theirs.
    pub fn find_outliers(
        &self,
        visibility: &Visibility,
        block: &Range<usize>,
        misfits: &[Misfit],
    ) -> Vec<bool> {
        let tiles = &visibility.tiles[block.clone()];
        let observers = || tiles.iter().flat_map(|tile| visibility.observers(tile));
        let frames = observers().map(|o| o.frame as usize + 1).max();
        let mut sums: Vec<Option<Box<BlockExcess>>> = vec![None; frames.unwrap_or(0)];
        let excess: Vec<f32> = misfits.iter().map(|m| self.typical.excess(m)).collect();
        let mut next = excess.iter();
        for tile in tiles {
            for (observer, z) in visibility.observers(tile).iter().zip(&mut next) {
                let sums = sums[observer.frame as usize].get_or_insert_default();
                sums.add(tile, z.min(MAX_NEIGHBOUR_EXCESS));
            }
        }
        let mut next = excess.iter();
        let mut is_outlier = Vec::with_capacity(excess.len());
        for tile in tiles {
            for (observer, z) in visibility.observers(tile).iter().zip(&mut next) {
                let sums = sums[observer.frame as usize].as_ref();
                let is_combined = sums.is_some_and(|s| s.combined(tile) > MIN_OUTLIER_EXCESS);
                is_outlier.push(*z > MIN_OUTLIER_EXCESS || is_combined);
            }
        }
        is_outlier
    }

    /// Marks the outlying observers of a stretch, of this or another lattice `grid`.
    pub fn mark(
        &self,
        visibility: &Visibility,
        grid: &WallGrid,
        participants: &[usize],
    ) -> ObserverMarks {
        let mut marks = ObserverMarks::none(visibility.observers.len());
        for tile in &visibility.tiles {
            let outlying = self.tiles.get(&self.grid.tile_around(grid, &tile.id));
            let Some(outlying) = outlying else { continue };
            for k in tile.observers.clone() {
                let participant = participants[visibility.observers[k].frame as usize];
                if outlying.binary_search(&participant).is_ok() {
                    marks.set(k);
                }
            }
        }
        marks
    }
}

/// Excesses of a frame, summed over the neighbourhood of each tile of a block.
#[derive(Clone, Copy, Debug, Default)]
struct BlockExcess {
    /// Sum and number over a tile and its eight neighbours; the block has a ring of tiles around
    /// it.
    cells: [[(f32, f32); BLOCK as usize + 2]; BLOCK as usize + 2],
}

impl BlockExcess {
    /// Row and column of a tile in `cells`.
    fn position(tile: &Tile) -> (usize, usize) {
        let within = |k: i64| k.rem_euclid(BLOCK) as usize + 1;
        (within(tile.id.row), within(tile.id.column))
    }

    /// Adds the excess of a tile to its neighbourhoods.
    fn add(&mut self, tile: &Tile, z: f32) {
        let (row, column) = Self::position(tile);
        for cells in &mut self.cells[row - 1..=row + 1] {
            for (sum, number) in &mut cells[column - 1..=column + 1] {
                *sum += z;
                *number += 1.0;
            }
        }
    }

    /// Excess of one tile with the significance of the neighbourhood: `Σz/√n`.
    fn combined(&self, tile: &Tile) -> f32 {
        let (row, column) = Self::position(tile);
        let (sum, number) = self.cells[row][column];
        sum / number.max(1.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::frame_estimate::FrameEstimate;
    use crate::samples::visibility::{Exclusions, PosedFrame};
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use tunnelstitch_core::frames::GreyImage;
    use tunnelstitch_core::test_wall::{TestWall, waves};
    use tunnelstitch_geometry::camera::Sweep;
    use tunnelstitch_geometry::surface::Footprint;

    /// A glint in the centre of one frame, 40 grey levels bright and 6 pixels wide: its tiles are
    /// excluded there and nowhere else, with its flanks, where it is no brighter than the noise;
    /// and less than 1 % of the wall is.
    #[test]
    fn a_glint_and_its_flanks_are_excluded_and_the_wall_is_not() {
        const GLINTING: usize = 5;
        let wall = TestWall::ring(waves);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let noise = Normal::new(0.0f32, 2.0).unwrap();
        let images: Vec<GreyImage> = (wall.frames().into_iter().enumerate())
            .map(|(k, frame)| {
                let (w, h) = (frame.width(), frame.height());
                let data = frame.data().iter().enumerate().map(|(n, value)| {
                    let (x, y) = ((n % w) as f32 - 80.0, (n / w) as f32 - 60.0);
                    let glint = 40.0 * (-(x * x + y * y) / (2.0 * 36.0)).exp();
                    let glint = if k == GLINTING { glint } else { 0.0 };
                    value + glint + noise.sample(&mut rng)
                });
                GreyImage::new(w, h, data.collect())
            })
            .collect();
        let camera = wall.camera;
        let estimates = wall.poses.iter().map(|pose| FrameEstimate::at(*pose));
        let sampled_frames: Vec<SampledFrame> = (images.iter().zip(estimates))
            .map(|(image, estimate)| SampledFrame::new(image, camera, &estimate))
            .collect();
        let posed: Vec<PosedFrame> = wall
            .poses
            .iter()
            .enumerate()
            .map(|(index, pose)| PosedFrame {
                index,
                sweep: Sweep::default(),
                pose: *pose,
                footprint: Footprint::trace(&wall.circle, &camera, pose).unwrap(),
                active: true,
            })
            .collect();
        let model = NoiseModel {
            floor: 4.0 * 4.0 / 9.0,
            steepness: 0.001,
        };
        let grid = WallGrid::new(&wall.circle, 1.0 / camera.fy, 1.0);
        let rows = -40..40;
        let visibility = Visibility::find(
            &wall.circle,
            &grid,
            &camera.into(),
            None,
            &Exclusions::NONE,
            &posed,
            &rows,
        );
        let participants: Vec<usize> = (0..sampled_frames.len()).collect();
        let mut misfits = Vec::new();
        let mut workspace = TileWorkspace::default();
        for tile in &visibility.tiles {
            let points = TilePoints::new(&grid, &wall.circle, tile.id, &mut Vec::new());
            let observers = visibility.observers(tile).iter();
            let observations = observers.map(|o| o.observation(&sampled_frames));
            workspace.compute_misfits(&points, observations, &model);
            misfits.append(&mut workspace.misfits);
        }
        let mut mask = OutlierMask::new(grid, misfits);
        mask.detect(
            &wall.circle,
            &visibility,
            &participants,
            &sampled_frames,
            &model,
        );
        let marks = mask.mark(&visibility, &grid, &participants);
        let (mut near, mut excluded_near, mut elsewhere, mut excluded_elsewhere) = (0, 0, 0, 0);
        for tile in &visibility.tiles {
            let centre = TilePoints::new(&grid, &wall.circle, tile.id, &mut Vec::new()).centre;
            for k in tile.observers.clone() {
                let frame = visibility.observers[k].frame as usize;
                let pixel = camera
                    .project(&wall.poses[frame].to_camera(&centre.x_w))
                    .unwrap();
                // At 2.3 times its width the glint is 3 grey levels bright.
                let distance = (pixel.x - 80.0).hypot(pixel.y - 60.0);
                if frame == GLINTING && distance < 14.0 {
                    near += 1;
                    excluded_near += usize::from(marks.has(k));
                } else if frame != GLINTING || distance > 30.0 {
                    elsewhere += 1;
                    excluded_elsewhere += usize::from(marks.has(k));
                }
            }
        }
        assert!(near >= 6, "{near}");
        assert_eq!(excluded_near, near);
        let share = f64::from(excluded_elsewhere as u32) / f64::from(elsewhere as u32);
        assert!(share < 0.01, "{excluded_elsewhere} of {elsewhere}");
    }
}
