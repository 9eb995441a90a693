//! Lattice of wall samples in square tiles.

use nalgebra::Vector3;
use std::f64::consts::SQRT_2;
use tunnelstitch_geometry::surface::{Footprint, Surface, WallFrame, WallPoint};

/// Samples along the side of a tile.
pub const TILE: usize = 8;
/// Samples along the side of a tile with its ring, which the gradients need.
pub const SIDE: usize = TILE + 2;
/// Samples of a tile with its ring.
pub const AREA: usize = SIDE * SIDE;
/// Number of values in a vector; sums run in as many lanes, whatever the processor has.
pub const LANES: usize = 8;
/// A value at every sample of a tile with its ring, row by row (s runs fastest), padded to whole
/// vectors; the padding repeats the tile's centre and has no weight.
pub type Plane = [f32; AREA.next_multiple_of(LANES)];
/// A plane of zeros.
pub const ZERO: Plane = [0.0; AREA.next_multiple_of(LANES)];

/// Tiles along the side of a block, the unit of parallel work: about a hundredth of a frame.
pub const BLOCK: i64 = 8;

/// A regular lattice on the unrolled wall; a whole number of tiles goes around the section.
#[derive(Clone, Copy, Debug)]
pub struct WallGrid {
    /// Distance between samples along s, metres.
    pub spacing_s_m: f64,
    /// Distance between samples along h, metres.
    pub spacing_h_m: f64,
    /// Tiles around the section.
    pub columns: i64,
    /// Samples per pixel along each axis, at the distance that the lattice was laid out for.
    pub density: f64,
}

/// Index of a tile: column around the section, row along the axis (row 0 begins at h = 0).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TileId {
    /// `0..columns`.
    pub column: i64,
    /// Any integer.
    pub row: i64,
}

impl TileId {
    /// The block of the tile.
    pub fn block(&self) -> (i64, i64) {
        (self.row.div_euclid(BLOCK), self.column.div_euclid(BLOCK))
    }

    /// True for one in about `stride` tiles, spread over all of the wall: those with the first part
    /// of the fractions `frac(row √2 + column √3)`, which fill the unit interval evenly.
    ///
    /// Source: L. Kuipers and H. Niederreiter, "Uniform Distribution of Sequences", 1974.
    pub fn is_one_in(&self, stride: usize) -> bool {
        const SQRT_3: f64 = 1.732_050_807_568_877_2;
        let sum = self.row as f64 * SQRT_2 + self.column as f64 * SQRT_3;
        (sum - sum.floor()) * (stride as f64) < 1.0
    }
}

/// Quasi-random point of the unit square for a column and row:
/// `frac(row φ⁻¹ + column φ⁻²)` and its mirror, with φ³ = φ + 1.
///
/// Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
pub fn fractions(column: i64, row: i64) -> [f64; 2] {
    const PHI: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
    let fraction = |a: f64, b: f64| {
        let sum = row as f64 * a + column as f64 * b;
        sum - sum.floor()
    };
    [fraction(PHI[0], PHI[1]), fraction(PHI[1], PHI[0])]
}

impl WallGrid {
    /// A lattice with about `density` samples per pixel width of `pixel_size_m` on the wall.
    pub fn new(surface: &dyn Surface, pixel_size_m: f64, density: f64) -> Self {
        let spacing_m = pixel_size_m / density;
        let tiles = surface.perimeter_m() / (spacing_m * TILE as f64);
        let columns = (tiles.round() as i64).max(1);
        Self {
            spacing_s_m: surface.perimeter_m() / (columns as f64 * TILE as f64),
            spacing_h_m: spacing_m,
            columns,
            density,
        }
    }

    /// The lattice with the spacing along s along h, too: poses that are a little different, and
    /// with them the size of a pixel, have the same one, kilometres along the tunnel.
    #[must_use]
    pub fn squared(self) -> Self {
        Self {
            spacing_h_m: self.spacing_s_m,
            ..self
        }
    }

    /// Width and height of a tile, metres.
    pub fn tile_size_m(&self) -> (f64, f64) {
        (
            self.spacing_s_m * TILE as f64,
            self.spacing_h_m * TILE as f64,
        )
    }

    /// The tile of this lattice that contains the centre of a tile of another one on the same wall.
    pub fn tile_around(&self, other: &Self, tile: &TileId) -> TileId {
        let (width, height) = self.tile_size_m();
        let (other_width, other_height) = other.tile_size_m();
        let index = |k: i64, other: f64, own: f64| ((k as f64 + 0.5) * other / own).floor() as i64;
        TileId {
            column: index(tile.column, other_width, width).rem_euclid(self.columns),
            row: index(tile.row, other_height, height),
        }
    }

    /// The centre of a tile, shifted from the regular position by [`fractions`] of a sample.
    ///
    /// Walls are periodic along the lattice: courses of bricks run along its rows, so that a
    /// regular lattice would sample every joint at the same fraction, and interpolation errors
    /// would not average out.
    pub fn centre(&self, tile: TileId) -> WallPoint {
        let (width, height) = self.tile_size_m();
        let (column, row) = (tile.column as f64, tile.row as f64);
        let [along_s, along_h] = fractions(tile.column, tile.row);
        WallPoint {
            s_m: (column + 0.5) * width + (along_s - 0.5) * self.spacing_s_m,
            h_m: (row + 0.5) * height + (along_h - 0.5) * self.spacing_h_m,
        }
    }

    /// Coordinates along s and h of a tile's samples, ring included, metres.
    fn samples(&self, tile: TileId) -> ([f64; SIDE], [f64; SIDE]) {
        let centre = self.centre(tile);
        let reach = 0.5 * (SIDE - 1) as f64;
        (
            std::array::from_fn(|i| centre.s_m + (i as f64 - reach) * self.spacing_s_m),
            std::array::from_fn(|j| centre.h_m + (j as f64 - reach) * self.spacing_h_m),
        )
    }

    /// The part of the wall that a tile covers with its ring.
    pub fn area(&self, tile: TileId) -> Footprint {
        let (s, h) = self.samples(tile);
        Footprint {
            s_min_m: s[0],
            s_max_m: s[SIDE - 1],
            h_min_m: h[0],
            h_max_m: h[SIDE - 1],
        }
    }

    /// Writes the four corners of a tile with its ring into `points`, metres.
    pub fn corners(&self, surface: &dyn Surface, tile: TileId, points: &mut Vec<Vector3<f64>>) {
        let (s, h) = self.samples(tile);
        surface.lattice(&[s[0], s[SIDE - 1]], &[h[0], h[SIDE - 1]], points);
    }
}

/// World coordinates of the samples of one tile with its ring, relative to its centre, so that
/// single precision suffices.
#[derive(Clone, Debug)]
pub struct TilePoints {
    /// The wall at the tile's centre.
    pub centre: WallFrame,
    /// x of every sample minus the centre's, metres.
    pub dx: Plane,
    /// y of every sample minus the centre's, metres.
    pub dy: Plane,
    /// z of every sample minus the centre's, metres.
    pub dz: Plane,
}

impl TilePoints {
    /// The samples of `tile`; `scratch` is reusable memory.
    pub fn new(
        grid: &WallGrid,
        surface: &dyn Surface,
        tile: TileId,
        scratch: &mut Vec<Vector3<f64>>,
    ) -> Self {
        let centre = surface.frame(grid.centre(tile));
        let mut points = Self {
            centre,
            dx: ZERO,
            dy: ZERO,
            dz: ZERO,
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
    use tunnelstitch_geometry::surface::{Circle, shortest_arc};

    #[test]
    fn a_whole_number_of_tiles_goes_around() {
        let circle = Circle::new(3.0).unwrap();
        let grid = WallGrid::new(&circle, 0.0072, 1.0);
        let (width, _) = grid.tile_size_m();
        assert!((width * grid.columns as f64 - circle.perimeter_m()).abs() < 1e-9);
        assert!((grid.spacing_s_m / 0.0072 - 1.0).abs() < 0.01);
    }

    /// A tenth of a per mille in the size of pixels is millimetres of wall a kilometre on.
    #[test]
    fn the_squared_lattice_does_not_depend_on_small_changes_of_the_pixels_size() {
        let circle = Circle::new(3.0).unwrap();
        let of_size = |pixel_size_m: f64| WallGrid::new(&circle, pixel_size_m, 2.0).squared();
        let far = TileId {
            column: 7,
            row: 30_000,
        };
        let [a, b] = [0.0072, 0.0072 * 1.0001].map(|size_m| of_size(size_m).centre(far));
        assert_eq!((a.s_m, a.h_m), (b.s_m, b.h_m));
    }

    #[test]
    fn one_in_some_tiles_is_spread_over_all_of_the_wall() {
        for stride in [1, 8, 64] {
            let count = |rows: std::ops::Range<i64>| -> usize {
                let tiles = rows.flat_map(|row| (0..80).map(move |column| TileId { column, row }));
                tiles.filter(|tile| tile.is_one_in(stride)).count()
            };
            for first in [-3000, -7, 0, 90_000] {
                let expected = 80 * 60 / stride;
                let found = count(first..first + 60);
                assert!(
                    found.abs_diff(expected) <= expected / 10,
                    "{stride}: {found}"
                );
            }
        }
    }

    #[test]
    fn tile_is_found_in_a_coarser_lattice() {
        let circle = Circle::new(3.0).unwrap();
        let (fine, coarse) = (
            WallGrid::new(&circle, 0.02, 2.0),
            WallGrid::new(&circle, 0.02, 1.0),
        );
        let (width, height) = coarse.tile_size_m();
        for (column, row) in [(0, 0), (5, -7), (fine.columns - 1, 13)] {
            let tile = TileId { column, row };
            let around = coarse.tile_around(&fine, &tile);
            assert!((0..coarse.columns).contains(&around.column));
            let (a, b) = (fine.centre(tile), coarse.centre(around));
            // Centres are shifted by up to a sample from their regular positions.
            let along = shortest_arc(a.s_m - b.s_m, circle.perimeter_m()).abs();
            assert!(along < 0.5 * width + 0.02, "{along}");
            assert!((a.h_m - b.h_m).abs() < 0.5 * height + 0.02);
        }
        assert_eq!(
            fine.tile_around(&fine, &TileId { column: 3, row: -2 }),
            TileId { column: 3, row: -2 }
        );
    }

    /// Gaps and overlaps of neighbours stay below a sample, across the seam of the section too.
    #[test]
    fn neighbouring_tiles_adjoin_within_a_sample() {
        let circle = Circle::new(3.0).unwrap();
        let grid = WallGrid::new(&circle, 0.02, 2.0);
        let (width, height) = grid.tile_size_m();
        let centre = |column: i64, row: i64| {
            grid.centre(TileId {
                column: column.rem_euclid(grid.columns),
                row,
            })
        };
        for (column, row) in [(0, 4), (7, -3), (grid.columns - 1, 11)] {
            let (a, right) = (centre(column, row), centre(column + 1, row));
            let along = shortest_arc(right.s_m - a.s_m, circle.perimeter_m());
            assert!((along - width).abs() < grid.spacing_s_m);
            let below = centre(column, row + 1);
            assert!((below.h_m - a.h_m - height).abs() < grid.spacing_h_m);
        }
    }

    /// Tiles of a row or column sample the wall at evenly distributed fractions.
    #[test]
    fn fractions_are_evenly_distributed() {
        let circle = Circle::new(3.0).unwrap();
        let grid = WallGrid::new(&circle, 0.02, 2.0);
        let fraction = |column: i64, row: i64| {
            let h_m = grid.centre(TileId { column, row }).h_m;
            (h_m / grid.spacing_h_m).rem_euclid(1.0)
        };
        for along in [true, false] {
            let mut quarters = [0; 4];
            for k in 0..40 {
                let f = if along {
                    fraction(k, 3)
                } else {
                    fraction(3, k)
                };
                quarters[(4.0 * f) as usize % 4] += 1;
            }
            assert!(
                quarters.iter().all(|n| (7..=13).contains(n)),
                "{quarters:?}"
            );
        }
    }
}
