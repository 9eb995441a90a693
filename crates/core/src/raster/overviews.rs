//! Incremental construction of overviews: an overview tile is complete once all tiles below it have
//! arrived.

use super::downsample::{HALF_EDGE_PX, reduce};
use super::error::RasterError;
use super::spec::{RasterSpec, RasterTile, TILE_EDGE_PX};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// A complete tile of a level.
#[derive(Debug)]
pub struct LevelTile {
    /// The level; 0 is full resolution, and every level halves the previous one.
    pub level: usize,
    /// The tile.
    pub tile: RasterTile,
}

/// A builder of the overviews of a picture whose tiles arrive in any order.
#[derive(Debug)]
pub struct OverviewBuilder {
    spec: RasterSpec,
    levels: usize,
    waiting: Waiting,
}

/// The arrived tiles and the incomplete overview tiles of a picture.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Waiting {
    /// Flags of the arrived tiles of full resolution, row by row.
    arrived: Vec<bool>,
    /// Incomplete overview tiles, by level, column and row.
    pending: HashMap<(usize, u32, u32), Pending>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Pending {
    /// Number of missing tiles below it.
    missing: u32,
    #[serde(with = "serde_bytes")]
    pixels: Vec<u8>,
}

impl OverviewBuilder {
    /// Creates a builder of `levels` levels, full resolution included.
    pub fn new(spec: RasterSpec, levels: usize) -> Result<Self, RasterError> {
        spec.check()?;
        Ok(Self {
            spec,
            levels,
            waiting: Waiting {
                arrived: vec![false; spec.tiles_of(0)],
                pending: HashMap::new(),
            },
        })
    }

    /// The state of the picture.
    pub(super) fn waiting(&self) -> &Waiting {
        &self.waiting
    }

    /// Resumes from the state of a picture of the same specification.
    pub(super) fn go_on(&mut self, waiting: Waiting) {
        self.waiting = waiting;
    }

    /// Adds tiles of full resolution and returns all tiles that become complete: these and overview
    /// tiles.
    ///
    /// # Errors
    /// [`RasterError::Tile`]; the batch is lost, and the picture remains incomplete.
    pub fn add(&mut self, batch: Vec<RasterTile>) -> Result<Vec<LevelTile>, RasterError> {
        for tile in &batch {
            self.take(tile)?;
        }
        let mut complete = Vec::with_capacity(2 * batch.len());
        let mut tiles = batch;
        for level in 0..self.levels {
            let above = self.reduce_into(level + 1, &tiles);
            complete.extend(tiles.into_iter().map(|tile| LevelTile { level, tile }));
            tiles = above;
        }
        Ok(complete)
    }

    /// Takes over what has arrived at a builder of the same picture, whose complete tiles of all
    /// levels are stored elsewhere; returns the overview tiles that become complete.
    ///
    /// # Errors
    /// [`RasterError::Tile`] for a tile that has arrived at both.
    pub(super) fn absorb(&mut self, part: Waiting) -> Result<Vec<LevelTile>, RasterError> {
        let [columns, _] = self.spec.grid(0).map(|count| count as usize);
        for (place, arrived) in part
            .arrived
            .iter()
            .enumerate()
            .filter(|(_, arrived)| **arrived)
        {
            if std::mem::replace(&mut self.waiting.arrived[place], *arrived) {
                return Err(RasterError::Tile {
                    column: (place % columns) as u32,
                    row: (place / columns) as u32,
                    what: "it came twice",
                });
            }
        }
        let mut parts: Vec<_> = part.pending.into_iter().collect();
        parts.sort_by_key(|(key, _)| *key);
        let mut parts = parts.into_iter().peekable();
        let (mut complete, mut tiles) = (Vec::new(), Vec::new());
        for level in 1..self.levels {
            let mut above = Vec::new();
            while let Some((key, part)) = parts.next_if(|((of, ..), _)| *of == level) {
                above.extend(self.unite(key, part));
            }
            above.extend(self.reduce_into(level, &tiles));
            complete.extend(tiles.into_iter().map(|tile| LevelTile {
                level: level - 1,
                tile,
            }));
            tiles = above;
        }
        let level = self.levels - 1;
        complete.extend(tiles.into_iter().map(|tile| LevelTile { level, tile }));
        Ok(complete)
    }

    /// Adds an incomplete overview tile of another builder to the own one; returns it if it becomes
    /// complete. Pixels that are missing are zero.
    fn unite(&mut self, key: (usize, u32, u32), part: Pending) -> Option<RasterTile> {
        let (level, column, row) = key;
        let all = parts(&self.spec, level, column, row);
        let united = match self.waiting.pending.remove(&key) {
            None => part,
            Some(mut own) => {
                for (own, part) in own.pixels.iter_mut().zip(&part.pixels) {
                    *own |= part;
                }
                // Of those that one lacks the other has the rest.
                own.missing = (own.missing + part.missing).saturating_sub(all);
                own
            }
        };
        if united.missing > 0 {
            self.waiting.pending.insert(key, united);
            return None;
        }
        let pixels = united.pixels;
        Some(RasterTile {
            column,
            row,
            pixels,
        })
    }

    /// Marks a tile of full resolution as arrived.
    fn take(&mut self, tile: &RasterTile) -> Result<(), RasterError> {
        let &RasterTile { column, row, .. } = tile;
        let refuse = |what| Err(RasterError::Tile { column, row, what });
        let [columns, rows] = self.spec.grid(0);
        if column >= columns || row >= rows {
            return refuse("it lies outside the picture");
        }
        if tile.pixels.len() != self.spec.tile_bytes() {
            return refuse("it has not the bytes of a tile");
        }
        let place = self.spec.place(0, column, row);
        if std::mem::replace(&mut self.waiting.arrived[place], true) {
            return refuse("it came twice");
        }
        Ok(())
    }

    /// Downsamples tiles into those of the next level `level` and returns those that become
    /// complete.
    fn reduce_into(&mut self, level: usize, tiles: &[RasterTile]) -> Vec<RasterTile> {
        if level >= self.levels {
            return Vec::new();
        }
        let spec = self.spec;
        let quarters: Vec<Vec<u8>> = tiles.par_map(|tile| {
            let extent = spec.extent(level - 1, tile.column, tile.row);
            reduce(&spec, &tile.pixels, extent)
        });
        let pending = &mut self.waiting.pending;
        let mut complete = Vec::new();
        for (tile, quarter) in tiles.iter().zip(quarters) {
            let (column, row) = (tile.column / 2, tile.row / 2);
            let key = (level, column, row);
            let above = pending.entry(key).or_insert_with(|| Pending {
                missing: parts(&spec, level, column, row),
                pixels: vec![0; spec.tile_bytes()],
            });
            let bytes = spec.pixel_bytes();
            let corner = (tile.row as usize % 2 * TILE_EDGE_PX + tile.column as usize % 2)
                * HALF_EDGE_PX
                * bytes;
            for (from, to) in quarter
                .chunks_exact(HALF_EDGE_PX * bytes)
                .zip(above.pixels[corner..].chunks_mut(TILE_EDGE_PX * bytes))
            {
                to[..HALF_EDGE_PX * bytes].copy_from_slice(from);
            }
            above.missing -= 1;
            if above.missing == 0
                && let Some(above) = pending.remove(&key)
            {
                complete.push(RasterTile {
                    column,
                    row,
                    pixels: above.pixels,
                });
            }
        }
        complete
    }
}

/// Number of tiles below an overview tile: up to four, fewer at the right and lower border.
fn parts(spec: &RasterSpec, level: usize, column: u32, row: u32) -> u32 {
    let [columns, rows] = spec.grid(level - 1);
    (columns - 2 * column).min(2) * (rows - 2 * row).min(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::test_picture::{grey_alpha, tiles};

    #[test]
    fn every_tile_of_every_level_is_complete_once() {
        let spec = grey_alpha(1300, 2100);
        let levels = spec.levels_to(1);
        let mut pyramid = OverviewBuilder::new(spec, levels).unwrap();
        let mut seen = Vec::new();
        for tile in tiles(&spec).into_iter().rev() {
            for done in pyramid.add(vec![tile]).unwrap() {
                seen.push((done.level, done.tile.row, done.tile.column));
            }
        }
        let count = seen.len();
        seen.sort();
        seen.dedup();
        assert_eq!(seen.len(), count);
        assert_eq!(count as u64, spec.tiles(levels));
        assert!(pyramid.waiting.pending.is_empty());
    }

    #[test]
    fn what_waits_is_no_more_than_promised() {
        use crate::raster::spec::TileOrder;
        let spec = grey_alpha(2500, 1600);
        for order in [TileOrder::Rows, TileOrder::Columns] {
            let mut pyramid = OverviewBuilder::new(spec, spec.levels_to_one_tile()).unwrap();
            let mut all = tiles(&spec);
            if order == TileOrder::Columns {
                all.sort_by_key(|tile| (tile.column, tile.row));
            }
            let mut most = 0;
            for tile in all {
                pyramid.add(vec![tile]).unwrap();
                most = most.max(pyramid.waiting.pending.len());
            }
            let most = (most * spec.tile_bytes()) as u64;
            assert!(most <= spec.pending_bytes(order), "{order:?}: {most}");
            assert!(2 * most >= spec.pending_bytes(order), "{order:?}: {most}");
        }
    }

    #[test]
    fn a_tile_from_elsewhere_or_seen_before_is_refused() {
        let spec = grey_alpha(600, 100);
        let mut pyramid = OverviewBuilder::new(spec, 2).unwrap();
        let all = tiles(&spec);
        pyramid.add(vec![all[0].clone()]).unwrap();
        let short = RasterTile {
            pixels: vec![0; 3],
            ..all[1].clone()
        };
        let outside = RasterTile {
            column: 2,
            ..all[1].clone()
        };
        for bad in [all[0].clone(), short, outside] {
            assert!(pyramid.add(vec![bad]).is_err());
        }
    }
}
