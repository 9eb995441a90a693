//! The grid of nodes over the canvas at which frames are chosen, and where pixels lie between them.

use super::multi_band_blending::COARSEST;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::tiles::Tile;
use crate::render::sampling::point_batch::RUN;
use crate::render::warp::patches::PATCH;
use std::ops::Range;

/// Distance of the grid's nodes, canvas pixels, unless there would be too many.
const STEP_PX: f64 = 8.0;
/// The most nodes of a grid; beyond, they are farther apart.
const NODES: usize = 4 << 20;

/// Distance of the nodes on a canvas, pixels: by the canvas alone, so that the panorama does not
/// depend on the memory.
pub fn step_px(canvas: &Canvas) -> f64 {
    let mut step = STEP_PX;
    loop {
        let grid = canvas.grid(step, COARSEST);
        if grid.pixels() <= NODES || grid.columns <= COARSEST {
            return step;
        }
        step *= 2.0;
    }
}

/// The grid over a canvas.
pub fn grid(canvas: &Canvas) -> Canvas {
    canvas.grid(step_px(canvas), COARSEST)
}

/// Where the columns of a tile lie between the nodes.
pub struct Across {
    pub cells: Vec<Cell>,
    /// How far each column lies from the node before to the one after, 0 to 1; 0 beyond the last.
    pub t: [f32; RUN],
    pub columns: usize,
}

impl Across {
    /// Number of columns.
    pub fn len(&self) -> usize {
        self.columns
    }

    /// How far each column lies from the node before to the one after, 0 to 1; anything beyond the
    /// last.
    pub fn between(&self) -> &[f32; RUN] {
        &self.t
    }
}

/// Columns of a tile between the same two nodes.
pub struct Cell {
    pub columns: Range<usize>,
    pub before: usize,
    pub after: usize,
}

/// A row between two rows of nodes.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    pub before: usize,
    pub after: usize,
    /// How far from the one to the other, 0 to 1.
    pub t: f32,
}

impl Between {
    /// How far from the one row to the other, 0 to 1.
    pub fn t(&self) -> f32 {
        self.t
    }
}

/// The rows of a tile, cut where they pass a row of nodes and where one row of patches ends and the
/// next begins.
pub fn strips(down: &[Between]) -> impl Iterator<Item = Range<usize>> {
    let key = |row: usize| (down[row].before, row / PATCH);
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

/// The node before a column of the canvas, from −1 on, and how far from it to the next one the
/// column lies.
pub fn column_of(grid: &Canvas, canvas: &Canvas, column: u32) -> (i64, f32) {
    let scale = f64::from(grid.columns) / f64::from(canvas.columns);
    let at = (f64::from(column) + 0.5) * scale - 0.5;
    let before = at.floor();
    (before as i64, (at - before) as f32)
}

/// Where the columns of a tile lie between the nodes.
pub fn across(grid: &Canvas, canvas: &Canvas, tile: &Tile) -> Across {
    let count = i64::from(grid.columns);
    let mut cells: Vec<Cell> = Vec::new();
    let mut t = [0.0; RUN];
    let mut cell = i64::MIN;
    for (column, t) in t.iter_mut().enumerate().take(tile.columns as usize) {
        let before;
        (before, *t) = column_of(grid, canvas, tile.column + column as u32);
        if before != cell {
            cell = before;
            cells.push(Cell {
                columns: column..column,
                before: cell.rem_euclid(count) as usize,
                after: (cell + 1).rem_euclid(count) as usize,
            });
        }
        if let Some(cell) = cells.last_mut() {
            cell.columns.end = column + 1;
        }
    }
    Across {
        cells,
        t,
        columns: tile.columns as usize,
    }
}

/// Where a row of the canvas lies between the nodes.
pub fn row_of(grid: &Canvas, canvas: &Canvas, row: u32) -> Between {
    let last = grid.rows as usize - 1;
    let scale = grid.px_per_metre / canvas.px_per_metre;
    let at = ((f64::from(row) + 0.5) * scale - 0.5).max(0.0);
    let before = (at as usize).min(last);
    Between {
        before,
        after: (before + 1).min(last),
        t: (at - before as f64).min(1.0) as f32,
    }
}
