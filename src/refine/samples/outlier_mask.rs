//! What is in a frame but not on the wall: glints, things that moved, smears.
//!
//! The robust loss rejects what stands out by itself, sample by sample. The flanks of a glint do
//! not: a few grey levels too bright, over some pixels, they pass for noise, yet they move with the
//! camera, and on a faint wall they are as steep as anything on it. All samples of a tile together
//! tell them from noise. For each frame that sees a tile
//!
//! `R = Σ_x v ρ(e)/v / Σ_x v`,   e: residual from the median over the frames,
//!
//! is about ½ whatever the texture, if the frame shows the wall. What R is usual is read from the
//! survey itself, the median and the spread for flat tiles and for steep ones; a frame is left out
//! of a tile where R exceeds what is usual by [`SURE`] times the spread, or where it and the tiles
//! around it do so together.
//!
//! Decided once before a solve, not step by step: the observations stay the same while the poses
//! move.

use crate::numerics::simd_dispatch::wide;
use crate::refine::samples::observer_marks::ObserverMarks;
use crate::refine::samples::visibility::{Tile, Visibility};
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::{BLOCK, TileId, TilePoints, WallGrid};
use crate::refine::tiles::residual_weighting::{NoiseModel, median_and_sigma};
use crate::refine::tiles::tile::{Misfit, TileWorkspace};
use crate::surface::Surface;
use rayon::prelude::*;
use std::collections::HashMap;

/// Spreads above the usual from which on a frame does not show the wall.
const SURE: f32 = 5.0;
/// Spreads at the most that a tile counts for with its neighbours.
const MOST: f32 = 15.0;
/// Classes of steepness, with as many tiles in each.
const CLASSES: usize = 8;
/// The spread is no smaller than this: tiles differ in how sharp the frames show them.
const LEAST_SPREAD: f32 = 0.08;

/// What misfit is usual.
#[derive(Clone, Debug)]
struct Usual {
    /// Steepness up to which a class goes, median of R and its spread.
    classes: Vec<(f32, f32, f32)>,
}

impl Usual {
    /// Reads it from the misfits of some tiles.
    fn of(mut misfits: Vec<Misfit>) -> Self {
        misfits.sort_unstable_by(|a, b| a.steepness.total_cmp(&b.steepness));
        let size = misfits.len().div_ceil(CLASSES).max(1);
        let classes = misfits.chunks(size).map(|class| {
            let mut values: Vec<f32> = class.iter().map(|m| m.loss).collect();
            let (median, sigma) = median_and_sigma(&mut values);
            let last = class.last().map_or(0.0, |m| m.steepness);
            (last, median, sigma.max(LEAST_SPREAD))
        });
        Self {
            classes: classes.collect(),
        }
    }

    /// By how many spreads a misfit exceeds the usual.
    fn excess(&self, misfit: &Misfit) -> f32 {
        let class = self
            .classes
            .iter()
            .find(|(last, _, _)| misfit.steepness <= *last)
            .or(self.classes.last());
        class.map_or(0.0, |(_, median, spread)| (misfit.loss - median) / spread)
    }
}

/// Where frames show something else than the wall.
#[derive(Clone, Debug)]
pub struct OutlierMask {
    grid: WallGrid,
    usual: Usual,
    /// The participants that do, ascending, tile by tile.
    tiles: HashMap<TileId, Vec<usize>>,
}

impl OutlierMask {
    /// Nothing yet; `misfits` are those of some tiles of `grid`.
    pub fn new(grid: WallGrid, misfits: Vec<Misfit>) -> Self {
        Self {
            grid,
            usual: Usual::of(misfits),
            tiles: HashMap::new(),
        }
    }

    /// Forgets what it has found: the stretches to come show other tiles.
    pub fn forget(&mut self) {
        self.tiles.clear();
    }

    /// Looks at all tiles of a stretch; `frames` are the participants whose `views` these are.
    pub fn look(
        &mut self,
        surface: &dyn Surface,
        visibility: &Visibility,
        frames: &[usize],
        views: &[SampledFrame],
        noise: &NoiseModel,
    ) {
        let found = visibility.blocks.par_iter().map(|block| {
            let tiles = &visibility.tiles[block.clone()];
            let mut work = TileWorkspace::default();
            let mut scratch = Vec::new();
            let mut excess = Vec::new();
            let mut around: Vec<Option<Box<Neighbourhood>>> = vec![None; views.len()];
            for tile in tiles {
                let points = TilePoints::new(&self.grid, surface, tile.id, &mut scratch);
                let observers = visibility.observers(tile);
                wide(
                    #[inline(always)]
                    || work.misfit(&points, observers.iter().map(|o| o.seen(views)), noise),
                );
                for (observer, misfit) in observers.iter().zip(&work.misfits) {
                    let z = self.usual.excess(misfit);
                    excess.push(z);
                    let around = around[observer.frame as usize].get_or_insert_default();
                    around.add(tile, z.min(MOST));
                }
            }
            let mut excess = excess.into_iter();
            let mut found = Vec::new();
            for tile in tiles {
                let observers = visibility.observers(tile).iter().zip(&mut excess);
                let foreign = observers.filter(|(observer, z)| {
                    let around = around[observer.frame as usize].as_ref();
                    *z > SURE || around.is_some_and(|around| around.together(tile) > SURE)
                });
                let foreign = foreign.map(|(observer, _)| frames[observer.frame as usize]);
                let foreign: Vec<usize> = foreign.collect();
                if !foreign.is_empty() {
                    found.push((tile.id, foreign));
                }
            }
            found
        });
        self.tiles.extend(found.collect::<Vec<_>>().concat());
    }

    /// For each observer in a stretch of another lattice, whether it shows something else there.
    pub fn among(
        &self,
        visibility: &Visibility,
        grid: &WallGrid,
        frames: &[usize],
    ) -> ObserverMarks {
        let mut marks = ObserverMarks::none(visibility.observers.len());
        for tile in &visibility.tiles {
            let foreign = self.tiles.get(&self.grid.tile_around(grid, &tile.id));
            let Some(foreign) = foreign else { continue };
            for k in tile.observers.clone() {
                let frame = frames[visibility.observers[k].frame as usize];
                if foreign.binary_search(&frame).is_ok() {
                    marks.set(k);
                }
            }
        }
        marks
    }
}

/// A frame's excesses over a block.
#[derive(Clone, Copy, Debug, Default)]
struct Neighbourhood {
    /// Sum and number over a tile and its neighbours, with a ring around the block.
    cells: [[(f32, f32); BLOCK as usize + 2]; BLOCK as usize + 2],
}

impl Neighbourhood {
    fn place(tile: &Tile) -> (usize, usize) {
        let within = |k: i64| k.rem_euclid(BLOCK) as usize + 1;
        (within(tile.id.row), within(tile.id.column))
    }

    fn add(&mut self, tile: &Tile, z: f32) {
        let (row, column) = Self::place(tile);
        for cells in &mut self.cells[row - 1..=row + 1] {
            for (sum, number) in &mut cells[column - 1..=column + 1] {
                *sum += z;
                *number += 1.0;
            }
        }
    }

    /// `Σz/√n`: as sure as one tile with that excess.
    fn together(&self, tile: &Tile) -> f32 {
        let (row, column) = Self::place(tile);
        let (sum, number) = self.cells[row][column];
        sum / number.max(1.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Sweep;
    use crate::frames::GreyImage;
    use crate::refine::parameters::frame_estimate::FrameEstimate;
    use crate::refine::samples::visibility::{Exclusions, PosedFrame};
    use crate::surface::Footprint;
    use crate::test_wall::{TestWall, waves};
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// A glint in the middle of one frame, 40 grey levels bright and 6 pixels wide: its tiles are
    /// left out there and nowhere else, its flanks too, where it is no brighter than the noise; and
    /// next to nothing of what is wall.
    #[test]
    fn a_glint_is_left_out_with_its_flanks_and_the_wall_is_not() {
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
        let views: Vec<SampledFrame> = (images.iter().zip(estimates))
            .map(|(image, estimate)| SampledFrame::new(image, camera, &estimate))
            .collect();
        let placed: Vec<PosedFrame> = wall
            .poses
            .iter()
            .map(|pose| PosedFrame {
                sweep: Sweep::default(),
                pose: *pose,
                footprint: Footprint::within(&wall.circle, &camera, pose, 6.0).unwrap(),
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
            &camera,
            None,
            &Exclusions::NOTHING,
            &placed,
            &rows,
        );
        let frames: Vec<usize> = (0..views.len()).collect();
        let mut misfits = Vec::new();
        let mut work = TileWorkspace::default();
        for tile in &visibility.tiles {
            let points = TilePoints::new(&grid, &wall.circle, tile.id, &mut Vec::new());
            let observers = visibility.observers(tile).iter();
            work.misfit(&points, observers.map(|o| o.seen(&views)), &model);
            misfits.append(&mut work.misfits);
        }
        let mut foreign = OutlierMask::new(grid, misfits);
        foreign.look(&wall.circle, &visibility, &frames, &views, &model);
        let marks = foreign.among(&visibility, &grid, &frames);
        let (mut near, mut left_near, mut elsewhere, mut left_elsewhere) = (0, 0, 0, 0);
        for tile in &visibility.tiles {
            let centre = TilePoints::new(&grid, &wall.circle, tile.id, &mut Vec::new()).centre;
            for k in tile.observers.clone() {
                let frame = visibility.observers[k].frame as usize;
                let pixel = camera
                    .project(&wall.poses[frame].to_camera(&centre.x_w))
                    .unwrap();
                // Where 3 grey levels are left of it: 2.3 times its width.
                let distance = (pixel.x - 80.0).hypot(pixel.y - 60.0);
                if frame == GLINTING && distance < 14.0 {
                    near += 1;
                    left_near += usize::from(marks.has(k));
                } else if frame != GLINTING || distance > 30.0 {
                    elsewhere += 1;
                    left_elsewhere += usize::from(marks.has(k));
                }
            }
        }
        assert!(near >= 6, "{near}");
        assert_eq!(left_near, near);
        let share = f64::from(left_elsewhere as u32) / f64::from(elsewhere as u32);
        assert!(share < 0.01, "{left_elsewhere} of {elsewhere}");
    }
}
