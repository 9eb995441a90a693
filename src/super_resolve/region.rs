//! Fine pixels on the unrolled wall.

use crate::surface::{WallPoint, shortest_arc};

/// A raster of fine pixels on the unrolled wall: column `j` and row `i` (from 0) have their centre
/// at `s = s_start + (j + ½) Δs`, `h = h_start + (i + ½) Δh`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Columns around the section: the last meets the first.
    pub columns: i64,
    /// Distance of neighbours along s and h, metres.
    pub spacing_m: [f64; 2],
    /// s and h of the first edges of column 0 and row 0, metres.
    pub start_m: [f64; 2],
}

/// A rectangle of a lattice's pixels: a tile with its margin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First column; below 0 or beyond the last, columns go on around the tunnel.
    pub column: i64,
    /// First row; any integer.
    pub row: i64,
    /// Number of columns, no more than the lattice has.
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
    pub(super) fn wall(&self, lattice: &Lattice, [across, down]: [f64; 2]) -> WallPoint {
        let [ds, dh] = lattice.spacing_m;
        WallPoint {
            s_m: lattice.start_m[0] + (self.column as f64 + across * self.columns as f64) * ds,
            h_m: lattice.start_m[1] + (self.row as f64 + down * self.rows as f64) * dh,
        }
    }

    /// The way from wall points to places in the region.
    pub(super) fn chart(&self, lattice: &Lattice) -> Chart {
        Chart {
            middle: self.wall(lattice, [0.5, 0.5]),
            perimeter_m: lattice.columns as f64 * lattice.spacing_m[0],
            inverse_m: lattice.spacing_m.map(f64::recip),
            half: [0.5 * self.columns as f64, 0.5 * self.rows as f64],
        }
    }
}

/// Where wall points lie in a region.
pub(super) struct Chart {
    middle: WallPoint,
    perimeter_m: f64,
    inverse_m: [f64; 2],
    half: [f64; 2],
}

impl Chart {
    /// In fine pixels from the region's first corner (the first pixel's middle is at ½): the
    /// nearest way around to the region's middle.
    pub fn place(&self, wall: &WallPoint) -> [f32; 2] {
        let s_m = shortest_arc(wall.s_m - self.middle.s_m, self.perimeter_m);
        let h_m = wall.h_m - self.middle.h_m;
        [
            (s_m * self.inverse_m[0] + self.half[0]) as f32,
            (h_m * self.inverse_m[1] + self.half[1]) as f32,
        ]
    }
}
