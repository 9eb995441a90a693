//! Which frames are taken for the wall, tile by tile, and which are compared with it.

use crate::refine::samples::visibility::Visibility;
use crate::refine::tiles::grid::{TILE, TileId, WallGrid};
use crate::super_resolve::Region;
use crate::surface::Patches;
use std::ops::Range;

/// Who sees what of the tiles of a region.
pub struct ObservationMask {
    /// Which tiles.
    columns: Range<i64>,
    rows: Range<i64>,
    /// Fine pixels from the first tile's corner to the region's.
    offset: [f32; 2],
    /// Row by row, column by column, frame by frame.
    all: Vec<Observation>,
    frames: usize,
}

/// How a frame sees a tile.
#[derive(Clone, Copy, Default)]
pub struct Observation {
    /// The camera's shading there; 0 if what the frame shows there is not taken for the wall.
    pub shade: f32,
    /// The tile among those of the block, and the frame among its observers; None where the frame
    /// helps to find the wall, but is not compared.
    pub place: Option<(u32, u32)>,
}

impl ObservationMask {
    /// Besides the tiles in which a frame is compared, it is taken for the wall in those next to
    /// them, which it sees but partly, and next to tiles in which it does not show the wall it is
    /// not compared: otherwise frames would be drawn to where the wall is known better, away from
    /// the borders of what they show of it.
    pub fn new(
        ignored: &Patches,
        grid: &WallGrid,
        visibility: &Visibility,
        block: &Range<usize>,
        frames: &[usize],
        region: &Region,
    ) -> Self {
        let mut observations = Self::compared(grid, visibility, block, frames, region);
        let compared = observations.all.clone();
        for tile in observations.tiles() {
            let id = around(grid, tile);
            if visibility.tile(id).is_none() && ignored.meet(&grid.area(id)) {
                continue;
            }
            for (n, frame) in frames.iter().enumerate() {
                if !visibility.leaves_out(id, *frame) {
                    let shades = observations.next_to(tile).map(|k| compared[k + n].shade);
                    let shade = shades.fold(0.0, f32::max);
                    let observation = observations.at(tile, n);
                    if observation.shade == 0.0 {
                        observation.shade = shade;
                    }
                }
            }
        }
        for tile in observations.tiles() {
            for n in 0..frames.len() {
                if observations
                    .next_to(tile)
                    .any(|k| observations.all[k + n].shade == 0.0)
                {
                    observations.at(tile, n).place = None;
                }
            }
        }
        observations
    }

    /// Only the tiles in which frames are compared.
    fn compared(
        grid: &WallGrid,
        visibility: &Visibility,
        block: &Range<usize>,
        frames: &[usize],
        region: &Region,
    ) -> Self {
        let side = TILE as i64;
        // One more pixel: the region may lie up to one later than the tiles.
        let end = |first: i64, pixels: usize| (first + pixels as i64).div_euclid(side) + 1;
        let columns = region.column.div_euclid(side)..end(region.column, region.columns);
        let rows = region.row.div_euclid(side)..end(region.row, region.rows);
        let tiles = ((columns.end - columns.start) * (rows.end - rows.start)) as usize;
        let mut observations = Self {
            columns,
            rows,
            offset: [region.column, region.row].map(|pixel| pixel.rem_euclid(side) as f32),
            all: vec![Observation::default(); tiles * frames.len()],
            frames: frames.len(),
        };
        for tile in observations.tiles() {
            let Some((index, seen)) = visibility.tile(around(grid, tile)) else {
                continue;
            };
            let own = block.contains(&index);
            for (n, observer) in visibility.observers(seen).iter().enumerate() {
                if let Ok(frame) = frames.binary_search(&(observer.frame as usize)) {
                    *observations.at(tile, frame) = Observation {
                        shade: observer.shade,
                        place: own.then(|| ((index - block.start) as u32, n as u32)),
                    };
                }
            }
        }
        observations
    }

    /// The region's lattice begins these fractions of a fine pixel later than the tiles.
    pub fn shifted(mut self, fractions: [f64; 2]) -> Self {
        for (offset, fraction) in self.offset.iter_mut().zip(fractions) {
            *offset += fraction as f32;
        }
        self
    }

    /// The region's tiles; columns may go on around the section.
    fn tiles(&self) -> impl Iterator<Item = TileId> + use<> {
        let columns = self.columns.clone();
        self.rows.clone().flat_map(move |row| {
            let columns = columns.clone();
            columns.map(move |column| TileId { column, row })
        })
    }

    /// Where the tiles around a tile, as far as they are in the region, and itself begin.
    fn next_to(&self, tile: TileId) -> impl Iterator<Item = usize> + '_ {
        let near = |range: &Range<i64>, of: i64| range.start.max(of - 1)..range.end.min(of + 2);
        let columns = near(&self.columns, tile.column);
        near(&self.rows, tile.row).flat_map(move |row| {
            let columns = columns.clone();
            columns.map(move |column| self.start(TileId { column, row }))
        })
    }

    /// Where the frames of a tile begin.
    fn start(&self, tile: TileId) -> usize {
        let columns = (self.columns.end - self.columns.start) as usize;
        let (column, row) = (tile.column - self.columns.start, tile.row - self.rows.start);
        (row as usize * columns + column as usize) * self.frames
    }

    fn at(&mut self, tile: TileId, frame: usize) -> &mut Observation {
        let start = self.start(tile);
        &mut self.all[start + frame]
    }

    /// How a frame sees the tile around a place in the region.
    pub fn of(&self, [x, y]: [f32; 2], frame: usize) -> Observation {
        let tile = |at: f32, offset: f32| ((at + offset) / TILE as f32) as i64;
        let id = TileId {
            column: self.columns.start + tile(x, self.offset[0]),
            row: self.rows.start + tile(y, self.offset[1]),
        };
        self.all[self.start(id) + frame]
    }
}

/// The tile of the grid that a region's tile is.
fn around(grid: &WallGrid, tile: TileId) -> TileId {
    TileId {
        column: tile.column.rem_euclid(grid.columns),
        ..tile
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::joint::joint_block::region_of;
    use crate::refine::samples::observer_marks::ObserverMarks;
    use crate::refine::samples::visibility::Exclusions;
    use crate::refine::test_scene::placed_spiral;

    /// Where a frame shows a tile partly it helps; next to where it shows something else it is not
    /// compared.
    #[test]
    fn frames_are_taken_for_the_wall_up_to_their_borders_but_for_what_is_left_out() {
        let (circle, camera, grid, placed) = placed_spiral(6);
        let hidden = Exclusions::NOTHING;
        let rows = -1000..1000;
        let all = Visibility::find(&circle, &grid, &camera, None, &hidden, &placed, &rows);
        let sights_of = |visibility: &Visibility, block: &Range<usize>| {
            let region = region_of(&grid, &visibility.tiles[block.clone()]);
            let frames = visibility.frames(block);
            ObservationMask::new(&Patches::NONE, &grid, visibility, block, &frames, &region)
        };
        let (mut partly, mut compared) = (0, 0);
        for block in &all.blocks {
            let observations = sights_of(&all, block);
            for tile in observations.tiles() {
                let seen = all
                    .tile(around(&grid, tile))
                    .map(|(_, tile)| all.observers(tile));
                for (n, frame) in all.frames(block).into_iter().enumerate() {
                    let observation = observations.all[observations.start(tile) + n];
                    let wholly = seen.is_some_and(|s| s.iter().any(|o| o.frame as usize == frame));
                    partly += usize::from(observation.shade > 0.0 && !wholly);
                    compared += usize::from(observation.place.is_some());
                    assert!(!wholly || observation.shade == 1.0);
                    assert!(wholly || observation.place.is_none());
                }
            }
        }
        assert!(partly > 300 && compared > 600, "{partly} {compared}");

        let block = all.blocks[all.blocks.len() / 2].clone();
        let middle = block.start + block.len() / 2;
        let (id, observers) = (all.tiles[middle].id, all.tiles[middle].observers.clone());
        let frame = all.observers[observers.start].frame as usize;
        let mut marks = ObserverMarks::none(all.observers.len());
        marks.set(observers.start);
        let without = all.without(&marks);
        let block = without
            .blocks
            .iter()
            .find(|block| without.tiles[block.start].id.block() == id.block());
        let block = block.unwrap();
        let observations = sights_of(&without, block);
        let n = without.frames(block).binary_search(&frame).unwrap();
        assert_eq!(observations.all[observations.start(id) + n].shade, 0.0);
        assert!(observations.next_to(id).count() == 9);
        assert!(
            observations
                .next_to(id)
                .all(|k| observations.all[k + n].place.is_none())
        );
    }
}
