//! A rectangle of the canvas that may reach beyond its borders.

use crate::render::Canvas;
use crate::surface::{WallPoint, shortest_arc};

/// A rectangle of a canvas' pixels: a tile with its margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First column; below 0 or beyond the last, columns go on around the tunnel.
    pub column: i64,
    /// First row; below 0 or beyond the last, rows go on along the tunnel.
    pub row: i64,
    /// Number of columns, no more than the canvas has.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
}

impl Region {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.columns * self.rows
    }

    /// The wall point at a corner (0, 0), the middle (½, ½) or any other share of the region.
    pub(super) fn wall(&self, canvas: &Canvas, [across, down]: [f64; 2]) -> WallPoint {
        canvas.wall_at([
            self.column as f64 + across * self.columns as f64 - 0.5,
            self.row as f64 + down * self.rows as f64 - 0.5,
        ])
    }

    /// Where a wall point lies, in pixels from the region's first corner (the first pixel's middle is at ½): the nearest
    /// way around to the region's middle.
    pub(super) fn place(&self, canvas: &Canvas, wall: &WallPoint) -> [f32; 2] {
        let middle = self.wall(canvas, [0.5, 0.5]);
        let perimeter_m = f64::from(canvas.columns) / canvas.px_per_metre;
        let s_m = shortest_arc(wall.s_m - middle.s_m, perimeter_m);
        [
            (s_m * canvas.px_per_metre + 0.5 * self.columns as f64) as f32,
            ((wall.h_m - middle.h_m) * canvas.px_per_metre + 0.5 * self.rows as f64) as f32,
        ]
    }
}
