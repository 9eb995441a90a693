//! Candidate tiles: those that the footprints of frames may contain, and their corners.

use crate::tiles::grid::{BLOCK, TileId, WallGrid};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::ops::Range;
use tunnelstitch_geometry::surface::{Footprint, Surface, WallRegions};

/// Rows of tiles that a footprint covers.
pub fn covered_rows(grid: &WallGrid, footprint: &Footprint) -> Range<i64> {
    let (_, height) = grid.tile_size_m();
    (footprint.h_min_m / height).floor() as i64..(footprint.h_max_m / height).floor() as i64 + 1
}

/// Numbering of all tiles in some rows of the lattice, block by block, so that consecutive tiles
/// are neighbours on the wall.
pub struct TileNumbering<'g> {
    grid: &'g WallGrid,
    /// First row of blocks.
    first: i64,
    /// Number of rows of blocks.
    rows: i64,
    /// Number of columns of blocks.
    columns: i64,
}

/// Number of tiles in a block.
const BLOCK_TILES: i64 = BLOCK * BLOCK;

impl<'g> TileNumbering<'g> {
    /// Numbers the tiles of the blocks that `rows` reach.
    pub fn new(grid: &'g WallGrid, rows: &Range<i64>) -> Self {
        let first = rows.start.div_euclid(BLOCK);
        Self {
            grid,
            first,
            rows: (rows.end - 1).div_euclid(BLOCK) + 1 - first,
            columns: (grid.columns - 1) / BLOCK + 1,
        }
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        (self.rows * self.columns * BLOCK_TILES) as usize
    }

    /// Number of a tile.
    fn number(&self, tile: TileId) -> usize {
        let (row, column) = tile.block();
        let block = (row - self.first) * self.columns + column;
        let (row, column) = (tile.row.rem_euclid(BLOCK), tile.column.rem_euclid(BLOCK));
        (block * BLOCK_TILES + row * BLOCK + column) as usize
    }

    /// Tile of a number.
    pub fn id(&self, number: usize) -> TileId {
        let (block, within) = (number as i64 / BLOCK_TILES, number as i64 % BLOCK_TILES);
        TileId {
            column: block % self.columns * BLOCK + within % BLOCK,
            row: (self.first + block / self.columns) * BLOCK + within / BLOCK,
        }
    }

    /// Numbers of the tiles of a range.
    pub fn numbers(&self, range: &TileRange) -> impl Iterator<Item = usize> {
        let columns = range.columns.clone();
        range.rows.clone().flat_map(move |row| {
            columns.clone().map(move |column| {
                let column = column.rem_euclid(self.grid.columns);
                self.number(TileId { column, row })
            })
        })
    }

    /// Corners of all tiles in some frame's range, ring included, row by row; computed once for all
    /// frames. None for tiles that meet ignored parts of the wall.
    pub fn corners(
        &self,
        surface: &dyn Surface,
        ranges: &[TileRange],
        ignored: &WallRegions,
    ) -> Vec<Option<[Vector3<f64>; 4]>> {
        let mut is_candidate = vec![false; self.count()];
        for tile in ranges.iter().flat_map(|range| self.numbers(range)) {
            is_candidate[tile] = true;
        }
        let corners =
            is_candidate
                .par_iter()
                .enumerate()
                .map_init(Vec::new, |scratch, (k, is_candidate)| {
                    if !*is_candidate || ignored.intersects(&self.grid.area(self.id(k))) {
                        return None;
                    }
                    self.grid.corners(surface, self.id(k), scratch);
                    match scratch[..] {
                        [a, b, c, d] => Some([a, b, c, d]),
                        _ => None,
                    }
                });
        corners.collect()
    }
}

/// Rows and columns of the tiles in a frame's footprint; columns continue beyond the seam of the
/// section.
pub struct TileRange {
    rows: Range<i64>,
    columns: Range<i64>,
}

impl TileRange {
    /// The tiles of a footprint within `rows`.
    pub fn new(grid: &WallGrid, footprint: &Footprint, rows: &Range<i64>) -> Self {
        let (width, _) = grid.tile_size_m();
        let first = (footprint.s_min_m / width).floor() as i64;
        let last = (footprint.s_max_m / width).floor() as i64;
        let own = covered_rows(grid, footprint);
        Self {
            rows: own.start.max(rows.start)..own.end.min(rows.end),
            columns: first..(last + 1).min(first + grid.columns),
        }
    }
}
