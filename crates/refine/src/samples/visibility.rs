//! Observations: the frames that observe each tile of the wall.

use crate::samples::observer::Observer;
use crate::samples::observer_marks::ObserverMarks;
use crate::samples::tile_candidates::{TileNumbering, TileRange};
use crate::samples::tile_projection::project_tile;
use crate::thresholds::visibility::MIN_RELATIVE_SHARPNESS;
use crate::tiles::grid::{TileId, WallGrid};
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_core::frames::{CameraLight, Masks, PyramidMask};
use tunnelstitch_geometry::camera::{Cameras, Sweep};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Footprint, Surface, WallRegions};
use tunnelstitch_geometry::trajectory::Pose;

/// A tile and its observers.
#[derive(Clone, Debug)]
pub struct Tile {
    /// The tile.
    pub id: TileId,
    /// Range of its observers in [`Visibility::observers`].
    pub observers: Range<usize>,
}

/// A frame with its pose, at which the samples are selected.
#[derive(Clone, Copy, Debug)]
pub struct PosedFrame {
    /// Index of the frame in the survey.
    pub index: usize,
    /// Pose.
    pub pose: Pose,
    /// Motion during the readout.
    pub sweep: Sweep,
    /// Footprint on the wall.
    pub footprint: Footprint,
    /// True if the frame is estimated.
    pub active: bool,
}

/// Parts of the wall and of the images that are not compared.
#[derive(Clone, Debug)]
pub struct Exclusions<'a> {
    /// Ignored parts of the wall.
    pub ignored: &'a WallRegions,
    /// Masks of the pixels that show the wall.
    pub masks: &'a Masks,
}

#[cfg(test)]
impl Exclusions<'_> {
    /// No exclusions.
    pub const NONE: Exclusions<'static> = Exclusions {
        ignored: &WallRegions::NONE,
        masks: &Masks::NONE,
    };
}

/// The observations of a set of frames: every tile with at least two observers, one of them active.
///
/// A frame either observes a whole tile, with the ring that its gradients need, or not at all. So
/// every sample of a tile averages the same frames, which see it about equally sharp. The set stays
/// constant while the poses move, so that costs before and after a step are of the same samples.
#[derive(Clone, Debug, Default)]
pub struct Visibility {
    /// Tiles, block by block.
    pub tiles: Vec<Tile>,
    /// Observers, ascending by frame within a tile.
    pub observers: Vec<Observer>,
    /// Ranges of the tiles of one block, the units of parallel work.
    pub blocks: Vec<Range<usize>>,
    /// Tiles and frames that [`Visibility::exclude`] has removed, in the order of the tiles.
    excluded: Vec<(TileId, u32)>,
}

impl Visibility {
    /// Finds the tiles in `rows` of the lattice that the frames `posed` observe.
    pub fn find(
        surface: &dyn Surface,
        grid: &WallGrid,
        cameras: &Cameras,
        light: Option<&CameraLight>,
        exclusions: &Exclusions,
        posed: &[PosedFrame],
        rows: &Range<i64>,
    ) -> Self {
        let numbering = TileNumbering::new(grid, rows);
        let ranges: Vec<TileRange> = posed
            .iter()
            .map(|frame| TileRange::new(grid, &frame.footprint, rows))
            .collect();
        let corners = numbering.corners(surface, &ranges, exclusions.ignored);
        let observed: Vec<Vec<(usize, Observer)>> = (0..posed.len()).par_map(|k| {
            let (frame, range) = (&posed[k], &ranges[k]);
            let camera = &cameras.of(frame.index).with_sweep(&frame.sweep);
            let mut tiles = Vec::new();
            let mask = exclusions.masks.of(frame.index);
            let mask = mask.map(|mask| PyramidMask::for_camera(Arc::clone(mask), camera));
            for tile in numbering.numbers(range) {
                let Some(corners) = &corners[tile] else {
                    continue;
                };
                let projection = project_tile(grid, camera, mask.as_ref(), &frame.pose, corners);
                if let Some(projection) = projection {
                    tiles.push((tile, projection.observer(k, frame.index, camera, light)));
                }
            }
            tiles
        });
        // Counting sort by tile, which keeps the order of the frames.
        let mut starts = vec![0; numbering.count() + 1];
        for (tile, _) in observed.iter().flatten() {
            starts[tile + 1] += 1;
        }
        for tile in 0..numbering.count() {
            starts[tile + 1] += starts[tile];
        }
        let placeholder = Observer {
            frame: 0,
            pixels: 0.0,
            shade: 1.0,
        };
        let (mut sorted, mut next) = (vec![placeholder; starts[numbering.count()]], starts.clone());
        for (tile, observer) in observed.iter().flatten() {
            sorted[next[*tile]] = *observer;
            next[*tile] += 1;
        }

        let mut visibility = Self::default();
        for tile in 0..numbering.count() {
            let group = &sorted[starts[tile]..starts[tile + 1]];
            let sharpest = group.iter().fold(0.0f32, |most, o| most.max(o.pixels));
            let least = MIN_RELATIVE_SHARPNESS * sharpest;
            let sharp = group.iter().copied().filter(|o| o.pixels >= least);
            let mut active = sharp.clone().map(|o| posed[o.frame as usize].active);
            if sharp.clone().nth(1).is_none() || !active.any(|active| active) {
                continue;
            }
            visibility.push(numbering.id(tile), sharp);
        }
        visibility.find_blocks();
        visibility
    }

    /// Adds a tile; [`Visibility::find_blocks`] follows when all tiles are there.
    fn push(&mut self, id: TileId, observers: impl Iterator<Item = Observer>) {
        let start = self.observers.len();
        self.observers.extend(observers);
        self.tiles.push(Tile {
            id,
            observers: start..self.observers.len(),
        });
    }

    /// Finds the ranges of tiles of one block, and gives back memory that is not used.
    fn find_blocks(&mut self) {
        self.excluded.shrink_to_fit();
        self.tiles.shrink_to_fit();
        self.observers.shrink_to_fit();
        let mut start = 0;
        for tiles in self.tiles.chunk_by(|a, b| a.id.block() == b.id.block()) {
            self.blocks.push(start..start + tiles.len());
            start += tiles.len();
        }
    }

    /// Restricts the observations to the tiles `kept`, given block by block, ascending.
    pub fn restrict_to(&self, kept: &[Vec<usize>]) -> Self {
        let mut visibility = Self::default();
        for tile in kept.iter().flatten().map(|k| &self.tiles[*k]) {
            visibility.push(tile.id, self.observers(tile).iter().copied());
        }
        visibility.find_blocks();
        visibility
    }

    /// Removes the marked observers, and the tiles with fewer than two observers left.
    pub fn exclude(&self, marks: &ObserverMarks) -> Self {
        let mut visibility = Self::default();
        for tile in &self.tiles {
            let marked = tile.observers.clone().filter(|k| marks.has(*k));
            let frames = marked.map(|k| (tile.id, self.observers[k].frame));
            visibility.excluded.extend(frames);
            let remaining = tile.observers.clone().filter(|k| !marks.has(*k));
            if remaining.clone().nth(1).is_some() {
                visibility.push(tile.id, remaining.map(|k| self.observers[k]));
            }
        }
        visibility.find_blocks();
        visibility
    }

    /// The frames that observe some tile of a range, ascending.
    pub fn frames(&self, tiles: &Range<usize>) -> Vec<usize> {
        let tiles = self.tiles[tiles.clone()].iter();
        let observers = tiles.flat_map(|tile| self.observers(tile));
        let mut frames: Vec<usize> = observers.map(|o| o.frame as usize).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    /// The tile `id` with its index in [`Visibility::tiles`], if it is among these.
    pub fn tile(&self, id: TileId) -> Option<(usize, &Tile)> {
        let of = |block: &Range<usize>| self.tiles[block.start].id.block();
        let block = self.blocks.partition_point(|block| of(block) < id.block());
        let block = self.blocks.get(block)?.clone();
        let tiles = &self.tiles[block.clone()];
        let key = (id.row, id.column);
        let found = tiles.binary_search_by_key(&key, |tile| (tile.id.row, tile.id.column));
        found.ok().map(|k| (block.start + k, &tiles[k]))
    }

    /// True if a frame is excluded from a tile.
    pub fn is_excluded(&self, tile: TileId, frame: usize) -> bool {
        let key = |(tile, frame): (TileId, u32)| (tile.block(), tile.row, tile.column, frame);
        let searched = key((tile, frame as u32));
        let found = self
            .excluded
            .binary_search_by_key(&searched, |excluded| key(*excluded));
        found.is_ok()
    }

    /// Observers of a tile.
    pub fn observers(&self, tile: &Tile) -> &[Observer] {
        &self.observers[tile.observers.clone()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::posed_spiral;

    #[test]
    fn every_tile_is_observed_by_an_active_frame_and_another() {
        let (circle, camera, grid, mut posed) = posed_spiral(24);
        let active = 20..24;
        for (k, frame) in posed.iter_mut().enumerate() {
            frame.active = active.contains(&k);
        }
        let everywhere = -1000..1000;
        let found = Visibility::find(
            &circle,
            &grid,
            &camera.into(),
            None,
            &Exclusions::NONE,
            &posed,
            &everywhere,
        );
        assert!(!found.tiles.is_empty());
        for tile in &found.tiles {
            let observers = found.observers(tile);
            assert!(observers.len() >= 2);
            assert!(
                observers
                    .windows(2)
                    .all(|pair| pair[0].frame < pair[1].frame)
            );
            // At about the distance the grid was made for, a sample is about a pixel.
            assert!(observers.iter().all(|o| (0.4..2.0).contains(&o.pixels)));
            assert!(
                observers
                    .iter()
                    .any(|o| active.contains(&(o.frame as usize)))
            );
        }
        let tiles: usize = found.blocks.iter().map(|block| block.len()).sum();
        assert_eq!(tiles, found.tiles.len());
    }

    /// Every tile is found by its index, and its excluded observers are known.
    #[test]
    fn tiles_are_found_by_index_and_excluded_observers_are_known() {
        let (circle, camera, grid, posed) = posed_spiral(6);
        let exclusions = Exclusions::NONE;
        let rows = -1000..1000;
        let all = Visibility::find(
            &circle,
            &grid,
            &camera.into(),
            None,
            &exclusions,
            &posed,
            &rows,
        );
        for (k, tile) in all.tiles.iter().enumerate() {
            assert_eq!(all.tile(tile.id).map(|(found, _)| found), Some(k));
        }
        let absent = TileId {
            column: 0,
            row: 900,
        };
        assert!(all.tile(absent).is_none());
        let (tile, first) = (&all.tiles[17], all.tiles[17].observers.start);
        let mut marks = ObserverMarks::none(all.observers.len());
        marks.set(first);
        let reduced = all.exclude(&marks);
        let frames = all.observers(tile).iter().map(|o| o.frame as usize);
        for (n, frame) in frames.enumerate() {
            assert_eq!(reduced.is_excluded(tile.id, frame), n == 0);
            assert!(!reduced.is_excluded(all.tiles[18].id, frame));
        }
    }

    /// Two parts of the wall have the tiles of the whole.
    #[test]
    fn tiles_of_two_parts_are_those_of_the_whole() {
        let (circle, camera, grid, posed) = posed_spiral(12);
        let find = |rows| {
            Visibility::find(
                &circle,
                &grid,
                &camera.into(),
                None,
                &Exclusions::NONE,
                &posed,
                &rows,
            )
        };
        let (all, below, above) = (find(-100..100), find(-100..0), find(0..100));
        assert_eq!(all.observers, [below.observers, above.observers].concat());
    }
}
