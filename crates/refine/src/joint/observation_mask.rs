//! Observation mask: the frames that contribute to the wall of a region, tile by tile, and those
//! that are compared with it.

use crate::samples::visibility::Visibility;
use crate::tiles::grid::{TILE, TileId, WallGrid};
use std::ops::Range;
use tunnelstitch_geometry::surface::WallRegions;
use tunnelstitch_super_resolve::Region;

/// Observations of the tiles of a region.
pub struct ObservationMask {
    /// Columns of tiles; they may continue beyond the seam of the section.
    columns: Range<i64>,
    /// Rows of tiles.
    rows: Range<i64>,
    /// Fine pixels from the corner of the first tile to that of the region.
    offset: [f32; 2],
    /// Observations, row by row, column by column, frame by frame.
    observations: Vec<Observation>,
    /// Number of frames.
    frames: usize,
}

/// Observation of a tile by a frame.
#[derive(Clone, Copy, Default)]
pub struct Observation {
    /// The camera's shading; 0 if the frame does not contribute to the wall there.
    pub shade: f32,
    /// Index of the tile in the block, and of the frame among its observers; None if the frame
    /// contributes to the wall but is not compared.
    pub indices: Option<(u32, u32)>,
}

impl ObservationMask {
    /// The observations of a region around a block.
    ///
    /// A frame contributes to the wall in the tiles in which it is compared and in their
    /// neighbours, which it observes partly. It is not compared in neighbours of tiles to which it
    /// does not contribute. Otherwise frames would be attracted to where the wall is known better,
    /// away from the borders of their footprints.
    pub fn new(
        ignored: &WallRegions,
        grid: &WallGrid,
        visibility: &Visibility,
        block: &Range<usize>,
        frames: &[usize],
        region: &Region,
    ) -> Self {
        let mut mask = Self::compared(grid, visibility, block, frames, region);
        let compared = mask.observations.clone();
        for tile in mask.tiles() {
            let id = wrap(grid, tile);
            if visibility.tile(id).is_none() && ignored.intersects(&grid.area(id)) {
                continue;
            }
            for (n, frame) in frames.iter().enumerate() {
                if !visibility.is_excluded(id, *frame) {
                    let shades = mask.neighbourhood(tile).map(|k| compared[k + n].shade);
                    let shade = shades.fold(0.0, f32::max);
                    let observation = mask.at(tile, n);
                    if observation.shade == 0.0 {
                        observation.shade = shade;
                    }
                }
            }
        }
        for tile in mask.tiles() {
            for n in 0..frames.len() {
                if mask
                    .neighbourhood(tile)
                    .any(|k| mask.observations[k + n].shade == 0.0)
                {
                    mask.at(tile, n).indices = None;
                }
            }
        }
        mask
    }

    /// The observations of the tiles in which frames are compared, alone.
    fn compared(
        grid: &WallGrid,
        visibility: &Visibility,
        block: &Range<usize>,
        frames: &[usize],
        region: &Region,
    ) -> Self {
        let side = TILE as i64;
        // One more pixel, as the region may be shifted by up to one against the tiles.
        let end = |first: i64, pixels: usize| (first + pixels as i64).div_euclid(side) + 1;
        let columns = region.column.div_euclid(side)..end(region.column, region.columns);
        let rows = region.row.div_euclid(side)..end(region.row, region.rows);
        let tiles = ((columns.end - columns.start) * (rows.end - rows.start)) as usize;
        let mut mask = Self {
            columns,
            rows,
            offset: [region.column, region.row].map(|pixel| pixel.rem_euclid(side) as f32),
            observations: vec![Observation::default(); tiles * frames.len()],
            frames: frames.len(),
        };
        for tile in mask.tiles() {
            let Some((index, observed)) = visibility.tile(wrap(grid, tile)) else {
                continue;
            };
            let in_block = block.contains(&index);
            for (n, observer) in visibility.observers(observed).iter().enumerate() {
                if let Ok(frame) = frames.binary_search(&(observer.frame as usize)) {
                    *mask.at(tile, frame) = Observation {
                        shade: observer.shade,
                        indices: in_block.then(|| ((index - block.start) as u32, n as u32)),
                    };
                }
            }
        }
        mask
    }

    /// Shifts the region by these fractions of a fine pixel against the tiles.
    pub fn shifted(mut self, fractions: [f64; 2]) -> Self {
        for (offset, fraction) in self.offset.iter_mut().zip(fractions) {
            *offset += fraction as f32;
        }
        self
    }

    /// Tiles of the region; columns may continue beyond the seam of the section.
    fn tiles(&self) -> impl Iterator<Item = TileId> + use<> {
        let columns = self.columns.clone();
        self.rows.clone().flat_map(move |row| {
            let columns = columns.clone();
            columns.map(move |column| TileId { column, row })
        })
    }

    /// Indices of the first observations of a tile and of its neighbours within the region.
    fn neighbourhood(&self, tile: TileId) -> impl Iterator<Item = usize> + '_ {
        let near = |range: &Range<i64>, k: i64| range.start.max(k - 1)..range.end.min(k + 2);
        let columns = near(&self.columns, tile.column);
        near(&self.rows, tile.row).flat_map(move |row| {
            let columns = columns.clone();
            columns.map(move |column| self.start(TileId { column, row }))
        })
    }

    /// Index of the first observation of a tile.
    fn start(&self, tile: TileId) -> usize {
        let columns = (self.columns.end - self.columns.start) as usize;
        let (column, row) = (tile.column - self.columns.start, tile.row - self.rows.start);
        (row as usize * columns + column as usize) * self.frames
    }

    /// Observation of a tile by a frame.
    fn at(&mut self, tile: TileId, frame: usize) -> &mut Observation {
        let start = self.start(tile);
        &mut self.observations[start + frame]
    }

    /// Observation by a frame of the tile that contains a position in the region, fine pixels.
    pub fn observation(&self, [x, y]: [f32; 2], frame: usize) -> Observation {
        let tile = |at: f32, offset: f32| ((at + offset) / TILE as f32) as i64;
        let id = TileId {
            column: self.columns.start + tile(x, self.offset[0]),
            row: self.rows.start + tile(y, self.offset[1]),
        };
        self.observations[self.start(id) + frame]
    }
}

/// Wraps the column of a region's tile to that of the grid.
fn wrap(grid: &WallGrid, tile: TileId) -> TileId {
    TileId {
        column: tile.column.rem_euclid(grid.columns),
        ..tile
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::region::region_around;
    use crate::samples::observer_marks::ObserverMarks;
    use crate::samples::visibility::Exclusions;
    use crate::test_scene::posed_spiral;

    /// A frame contributes to tiles that it observes partly, and is not compared next to a tile
    /// that it is excluded from.
    #[test]
    fn frames_contribute_up_to_their_borders_except_where_excluded() {
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
        let mask_of = |visibility: &Visibility, block: &Range<usize>| {
            let region = region_around(&grid, &visibility.tiles[block.clone()]);
            let frames = visibility.frames(block);
            ObservationMask::new(
                &WallRegions::NONE,
                &grid,
                visibility,
                block,
                &frames,
                &region,
            )
        };
        let (mut partly, mut compared) = (0, 0);
        for block in &all.blocks {
            let mask = mask_of(&all, block);
            for tile in mask.tiles() {
                let observers = all
                    .tile(wrap(&grid, tile))
                    .map(|(_, tile)| all.observers(tile));
                for (n, frame) in all.frames(block).into_iter().enumerate() {
                    let observation = mask.observations[mask.start(tile) + n];
                    let wholly =
                        observers.is_some_and(|s| s.iter().any(|o| o.frame as usize == frame));
                    partly += usize::from(observation.shade > 0.0 && !wholly);
                    compared += usize::from(observation.indices.is_some());
                    assert!(!wholly || observation.shade == 1.0);
                    assert!(wholly || observation.indices.is_none());
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
        let reduced = all.exclude(&marks);
        let block = reduced
            .blocks
            .iter()
            .find(|block| reduced.tiles[block.start].id.block() == id.block());
        let block = block.unwrap();
        let mask = mask_of(&reduced, block);
        let n = reduced.frames(block).binary_search(&frame).unwrap();
        assert_eq!(mask.observations[mask.start(id) + n].shade, 0.0);
        assert!(mask.neighbourhood(id).count() == 9);
        assert!(
            mask.neighbourhood(id)
                .all(|k| mask.observations[k + n].indices.is_none())
        );
    }
}
