//! The lattice of wall samples, cut into square tiles.

use crate::surface::{Surface, WallFrame, WallPoint};
use nalgebra::Vector3;

/// Samples along the side of a tile.
pub const TILE: usize = 8;
/// Samples along the side of a tile with the ring that its gradients need.
pub const SIDE: usize = TILE + 2;
/// Samples of a tile with its ring.
pub const AREA: usize = SIDE * SIDE;

/// Tiles along the side of a block: the unit of parallel work, about a hundredth of a frame.
const BLOCK: i64 = 8;

/// A regular lattice on the unrolled wall; a whole number of tiles goes around the section.
#[derive(Clone, Copy, Debug)]
pub struct WallGrid {
    /// Distance between samples along s, metres.
    pub spacing_s_m: f64,
    /// Distance between samples along h, metres.
    pub spacing_h_m: f64,
    /// Tiles around the section.
    pub columns: i64,
}

/// Name of a tile: column around the section, row along the axis (row 0 begins at h = 0).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileId {
    /// `0..columns`.
    pub column: i64,
    /// Any integer.
    pub row: i64,
}

impl TileId {
    /// Orders tiles block by block along the axis, so that neighbours in order are neighbours on the wall.
    pub fn key(&self) -> (i64, i64, i64, i64) {
        let (block_row, block_column) = self.block();
        (block_row, block_column, self.row, self.column)
    }

    /// The block of the tile.
    pub fn block(&self) -> (i64, i64) {
        (self.row.div_euclid(BLOCK), self.column.div_euclid(BLOCK))
    }
}

impl WallGrid {
    /// A lattice with samples about `spacing_m` apart.
    pub fn new(surface: &dyn Surface, spacing_m: f64) -> Self {
        let tiles = surface.perimeter_m() / (spacing_m * TILE as f64);
        let columns = (tiles.round() as i64).max(1);
        Self {
            spacing_s_m: surface.perimeter_m() / (columns as f64 * TILE as f64),
            spacing_h_m: spacing_m,
            columns,
        }
    }

    /// Width and height of a tile, metres.
    pub fn tile_size_m(&self) -> (f64, f64) {
        (
            self.spacing_s_m * TILE as f64,
            self.spacing_h_m * TILE as f64,
        )
    }

    /// The middle of a tile.
    pub fn centre(&self, tile: TileId) -> WallPoint {
        let (width, height) = self.tile_size_m();
        WallPoint {
            s_m: (tile.column as f64 + 0.5) * width,
            h_m: (tile.row as f64 + 0.5) * height,
        }
    }

    /// Coordinates along s and h of a tile's samples, ring included.
    fn samples(&self, tile: TileId) -> ([f64; SIDE], [f64; SIDE]) {
        let centre = self.centre(tile);
        let reach = 0.5 * (SIDE - 1) as f64;
        (
            std::array::from_fn(|i| centre.s_m + (i as f64 - reach) * self.spacing_s_m),
            std::array::from_fn(|j| centre.h_m + (j as f64 - reach) * self.spacing_h_m),
        )
    }

    /// The four corners of a tile with its ring, in `points`.
    pub fn corners(&self, surface: &dyn Surface, tile: TileId, points: &mut Vec<Vector3<f64>>) {
        let (s, h) = self.samples(tile);
        surface.lattice(&[s[0], s[SIDE - 1]], &[h[0], h[SIDE - 1]], points);
    }
}

/// World coordinates of the samples of one tile with its ring, relative to its middle (so that single
/// precision is enough), row-major: s runs fastest.
#[derive(Clone, Debug)]
pub struct TilePoints {
    /// The wall at the tile's middle.
    pub centre: WallFrame,
    /// x of every sample minus the centre's, metres.
    pub dx: [f32; AREA],
    /// y of every sample minus the centre's, metres.
    pub dy: [f32; AREA],
    /// z of every sample minus the centre's, metres.
    pub dz: [f32; AREA],
}

impl TilePoints {
    /// The samples of `tile`; `scratch` is room for the work.
    pub fn new(
        grid: &WallGrid,
        surface: &dyn Surface,
        tile: TileId,
        scratch: &mut Vec<Vector3<f64>>,
    ) -> Self {
        let centre = surface.frame(grid.centre(tile));
        let mut points = Self {
            centre,
            dx: [0.0; AREA],
            dy: [0.0; AREA],
            dz: [0.0; AREA],
        };
        let (s, h) = grid.samples(tile);
        surface.lattice(&s, &h, scratch);
        for (k, x_w) in scratch.iter().enumerate() {
            let offset = x_w - centre.x_w;
            points.dx[k] = offset.x as f32;
            points.dy[k] = offset.y as f32;
            points.dz[k] = offset.z as f32;
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Circle;

    #[test]
    fn a_whole_number_of_tiles_goes_around() {
        let circle = Circle::new(3.0).unwrap();
        let grid = WallGrid::new(&circle, 0.0072);
        let (width, _) = grid.tile_size_m();
        assert!((width * grid.columns as f64 - circle.perimeter_m()).abs() < 1e-9);
        assert!((grid.spacing_s_m / 0.0072 - 1.0).abs() < 0.01);
    }

    #[test]
    fn neighbouring_tiles_share_their_rings() {
        let circle = Circle::new(3.0).unwrap();
        let grid = WallGrid::new(&circle, 0.01);
        let last = grid.columns - 1;
        // The ring left of the first column is the last sample of the last column.
        let at =
            |column| TilePoints::new(&grid, &circle, TileId { column, row: 4 }, &mut Vec::new());
        let (a, b) = (at(0), at(last));
        let world = |p: &TilePoints, k: usize| {
            p.centre.x_w + Vector3::new(f64::from(p.dx[k]), f64::from(p.dy[k]), f64::from(p.dz[k]))
        };
        let row = 3 * SIDE;
        assert!((world(&a, row) - world(&b, row + TILE)).norm() < 1e-6);
        assert!((world(&a, row + 1) - world(&b, row + TILE + 1)).norm() < 1e-6);
    }
}
