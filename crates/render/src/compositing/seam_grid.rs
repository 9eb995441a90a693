//! Grid of nodes at which frames are chosen, and positions of pixels between them.

use super::multi_band_blending::COARSEST_SPACING;
use crate::layout::canvas::Canvas;
use crate::layout::tiles::TILE_COLUMNS;
use crate::layout::tiles::Tile;
use crate::warp::patches::PATCH_EDGE;
use std::ops::Range;

/// Distance of the grid's nodes, canvas pixels, unless there would be too many. A higher value
/// needs less memory and makes coarser seams.
const NODE_SPACING_PX: f64 = 8.0;
/// Largest number of nodes; beyond it, they are farther apart. A higher value keeps seams fine in
/// longer panoramas and needs more memory.
const MAX_NODES: usize = 4 << 20;

/// Distance of the nodes on a canvas, pixels. It depends on the canvas alone, so that the panorama
/// does not depend on the memory.
pub fn node_spacing_px(canvas: &Canvas) -> f64 {
    let mut step = NODE_SPACING_PX;
    loop {
        let grid = canvas.grid(step, COARSEST_SPACING);
        if grid.pixels() <= MAX_NODES || grid.columns <= COARSEST_SPACING {
            return step;
        }
        step *= 2.0;
    }
}

/// Grid over a canvas.
pub fn grid(canvas: &Canvas) -> Canvas {
    canvas.grid(node_spacing_px(canvas), COARSEST_SPACING)
}

/// Columns of a tile between the nodes.
pub struct ColumnCells {
    pub cells: Vec<ColumnCell>,
    /// Position of each column from the node before to the one after, 0 to 1; 0 beyond the last.
    pub t: [f32; TILE_COLUMNS],
    pub columns: usize,
}

impl ColumnCells {
    /// Number of columns.
    pub fn len(&self) -> usize {
        self.columns
    }

    /// Position of each column from the node before to the one after, 0 to 1; no meaning beyond the
    /// last.
    pub fn between(&self) -> &[f32; TILE_COLUMNS] {
        &self.t
    }
}

/// Columns of a tile between the same two nodes.
pub struct ColumnCell {
    pub columns: Range<usize>,
    pub before: usize,
    pub after: usize,
}

/// Row of pixels between two rows of nodes.
#[derive(Clone, Copy, Debug)]
pub struct RowPosition {
    pub before: usize,
    pub after: usize,
    /// Position from the one to the other, 0 to 1.
    pub t: f32,
}

impl RowPosition {
    /// Position from the one row to the other, 0 to 1.
    pub fn t(&self) -> f32 {
        self.t
    }
}

/// Cuts the rows of a tile where they pass a row of nodes and where one row of patches ends and the
/// next begins.
pub fn strips(down: &[RowPosition]) -> impl Iterator<Item = Range<usize>> {
    let key = |row: usize| (down[row].before, row / PATCH_EDGE);
    let mut from = 0;
    std::iter::from_fn(move || {
        let own = (from < down.len()).then(|| key(from))?;
        let to = (from + 1..down.len())
            .find(|row| key(*row) != own)
            .unwrap_or(down.len());
        let strip = from..to;
        from = to;
        Some(strip)
    })
}

/// Node before a column of the canvas, from −1 on, and the column's position from it to the next
/// one.
pub fn column_position(grid: &Canvas, canvas: &Canvas, column: u32) -> (i64, f32) {
    let scale = f64::from(grid.columns) / f64::from(canvas.columns);
    let at = (f64::from(column) + 0.5) * scale - 0.5;
    let before = at.floor();
    (before as i64, (at - before) as f32)
}

/// Finds the columns of a tile between the nodes.
pub fn column_cells(grid: &Canvas, canvas: &Canvas, tile: &Tile) -> ColumnCells {
    let count = i64::from(grid.columns);
    let mut cells: Vec<ColumnCell> = Vec::new();
    let mut t = [0.0; TILE_COLUMNS];
    let mut cell = i64::MIN;
    for (column, t) in t.iter_mut().enumerate().take(tile.columns as usize) {
        let before;
        (before, *t) = column_position(grid, canvas, tile.column + column as u32);
        if before != cell {
            cell = before;
            cells.push(ColumnCell {
                columns: column..column,
                before: cell.rem_euclid(count) as usize,
                after: (cell + 1).rem_euclid(count) as usize,
            });
        }
        if let Some(cell) = cells.last_mut() {
            cell.columns.end = column + 1;
        }
    }
    ColumnCells {
        cells,
        t,
        columns: tile.columns as usize,
    }
}

/// Finds the nodes around a row of the canvas.
pub fn row_position(grid: &Canvas, canvas: &Canvas, row: u32) -> RowPosition {
    let last = grid.rows as usize - 1;
    let scale = grid.px_per_metre / canvas.px_per_metre;
    let at = ((f64::from(row) + 0.5) * scale - 0.5).max(0.0);
    let before = (at as usize).min(last);
    RowPosition {
        before,
        after: (before + 1).min(last),
        t: (at - before as f64).min(1.0) as f32,
    }
}
