//! Region of fine pixels around a block of tiles.

use crate::samples::visibility::Tile;
use crate::tiles::grid::{TILE, TileId, WallGrid};
use tunnelstitch_super_resolve::{MARGIN, Region};

/// The fine pixels of some tiles with a margin of [`MARGIN`].
pub fn region_around(grid: &WallGrid, tiles: &[Tile]) -> Region {
    let range = |of: fn(&TileId) -> i64| {
        let indices = || tiles.iter().map(|tile| of(&tile.id));
        indices().min().unwrap_or(0)..indices().max().unwrap_or(-1) + 1
    };
    let (columns, rows) = (range(|id| id.column), range(|id| id.row));
    let side = TILE as i64;
    // In a section hardly longer than the tiles, their margins meet.
    let width = columns.end - columns.start;
    let margin = ((grid.columns - width) * side / 2).min(MARGIN as i64);
    Region {
        column: columns.start * side - margin,
        row: rows.start * side - MARGIN as i64,
        columns: (width * side + 2 * margin) as usize,
        rows: (rows.end - rows.start) as usize * TILE + 2 * MARGIN,
    }
}
