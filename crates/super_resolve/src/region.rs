//! Grid of fine pixels on the unrolled wall, and its regions.

use tunnelstitch_geometry::surface::{WallPoint, shortest_arc};

/// Grid of fine pixels on the unrolled wall.
///
/// Column `j` and row `i` (from 0) have their centre at `s = s_start + (j + ½) Δs`,
/// `h = h_start + (i + ½) Δh`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FineGrid {
    /// Number of columns around the section; the last is adjacent to the first.
    pub columns: i64,
    /// Spacing along s and h, metres.
    pub spacing_m: [f64; 2],
    /// s and h of the outer edges of column 0 and row 0, metres.
    pub start_m: [f64; 2],
}

/// A rectangle of a grid's pixels: a tile with its margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First column; columns below 0 or beyond the last continue around the tunnel.
    pub column: i64,
    /// First row; any integer.
    pub row: i64,
    /// Number of columns, no more than the grid has.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
}

impl Region {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.columns * self.rows
    }

    /// Wall point at relative coordinates of the region: (0, 0) is a corner, (½, ½) the centre.
    pub(super) fn wall(&self, grid: &FineGrid, [across, down]: [f64; 2]) -> WallPoint {
        let [ds, dh] = grid.spacing_m;
        WallPoint {
            s_m: grid.start_m[0] + (self.column as f64 + across * self.columns as f64) * ds,
            h_m: grid.start_m[1] + (self.row as f64 + down * self.rows as f64) * dh,
        }
    }

    /// Map from wall points to coordinates in the region.
    pub(super) fn coordinates(&self, grid: &FineGrid) -> RegionCoordinates {
        RegionCoordinates {
            middle: self.wall(grid, [0.5, 0.5]),
            perimeter_m: grid.columns as f64 * grid.spacing_m[0],
            inverse_m: grid.spacing_m.map(f64::recip),
            half: [0.5 * self.columns as f64, 0.5 * self.rows as f64],
        }
    }
}

/// Map from wall points to coordinates in a region.
pub(super) struct RegionCoordinates {
    middle: WallPoint,
    perimeter_m: f64,
    inverse_m: [f64; 2],
    half: [f64; 2],
}

impl RegionCoordinates {
    /// Coordinates of a wall point, fine pixels from the region's first corner.
    ///
    /// The centre of the first pixel is at ½. The shorter arc to the region's centre is taken.
    pub fn of(&self, wall: &WallPoint) -> [f32; 2] {
        let s_m = shortest_arc(wall.s_m - self.middle.s_m, self.perimeter_m);
        let h_m = wall.h_m - self.middle.h_m;
        [
            (s_m * self.inverse_m[0] + self.half[0]) as f32,
            (h_m * self.inverse_m[1] + self.half[1]) as f32,
        ]
    }
}
