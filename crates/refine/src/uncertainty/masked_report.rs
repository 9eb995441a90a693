//! Report of the wall where frames show something else and were left out.

use serde::{Deserialize, Serialize};
use tunnelstitch_core::survey::MaskedWall;
use tunnelstitch_geometry::surface::Surface;

/// Largest number of places that are listed.
const MAX_PLACES: usize = 20;

/// The wall where half of the frames that see it or more were left out, because they show something
/// else: cables, brackets, lamps, water.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MaskedReport {
    /// Its area, square metres.
    pub area_m2: f64,
    /// Its share of the wall that two frames or more see, 0 to 1.
    pub share: f64,
    /// Area of the wall that two frames or more see, square metres.
    pub seen_m2: f64,
    /// The largest connected places, the largest first.
    pub places: Vec<MaskedPlace>,
}

/// A connected place of the wall, in a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MaskedPlace {
    /// From, metres.
    pub chainage_from_m: f64,
    /// To, metres.
    pub chainage_to_m: f64,
    /// From, degrees of θ as seen from the axis, below 360.
    pub angle_from_deg: f64,
    /// To; beyond 360 across θ = 0, and 360 more than the beginning all around.
    pub angle_to_deg: f64,
    /// Its area, square metres.
    pub area_m2: f64,
    /// Share of the frames that were left out there, 0 to 1.
    pub left_out_share: f64,
}

impl MaskedReport {
    /// Reports the masked part of the wall `surface`, which is `scale` times as large as it was
    /// given.
    pub fn new(masked: &MaskedWall, surface: &dyn Surface, scale: f64) -> Self {
        let hidden = |k: usize| masked.tiles()[k].is_hidden();
        let mut visited = vec![false; masked.tiles().len()];
        let mut places = Vec::new();
        for start in 0..visited.len() {
            if hidden(start) && !visited[start] {
                places.push(find_place(masked, start, &mut visited).report(masked, surface, scale));
            }
        }
        places.sort_by(|a, b| b.area_m2.total_cmp(&a.area_m2));
        // Of no places the sum is −0.
        let area_m2 = places.iter().map(|place| place.area_m2).sum::<f64>() + 0.0;
        places.truncate(MAX_PLACES);
        let seen_m2 = masked.seen_m2();
        Self {
            area_m2,
            share: if seen_m2 > 0.0 {
                area_m2 / seen_m2
            } else {
                0.0
            },
            seen_m2,
            places,
        }
    }
}

/// Extent of connected tiles; columns are counted on across the first.
struct Extent {
    rows: [i64; 2],
    columns: [i64; 2],
    tiles: usize,
    frames: u64,
    left_out: u64,
}

/// Finds the hidden tiles that are connected with one, diagonally as well.
fn find_place(masked: &MaskedWall, start: usize, visited: &mut [bool]) -> Extent {
    let first = masked.tiles()[start];
    let mut open = vec![(start, first.column)];
    visited[start] = true;
    let mut extent = Extent {
        rows: [first.row; 2],
        columns: [first.column; 2],
        tiles: 0,
        frames: 0,
        left_out: 0,
    };
    while let Some((k, column)) = open.pop() {
        let tile = masked.tiles()[k];
        extent.rows = [extent.rows[0].min(tile.row), extent.rows[1].max(tile.row)];
        extent.columns = [extent.columns[0].min(column), extent.columns[1].max(column)];
        extent.tiles += 1;
        extent.frames += u64::from(tile.frames);
        extent.left_out += u64::from(tile.left_out);
        for row in tile.row - 1..=tile.row + 1 {
            for next in column - 1..=column + 1 {
                let found = masked.index(row, next.rem_euclid(masked.columns()));
                let Some(found) = found.filter(|k| masked.tiles()[*k].is_hidden()) else {
                    continue;
                };
                if !visited[found] {
                    visited[found] = true;
                    open.push((found, next));
                }
            }
        }
    }
    extent
}

impl Extent {
    /// The place on a wall of which `surface` is a `scale`-th.
    fn report(&self, masked: &MaskedWall, surface: &dyn Surface, scale: f64) -> MaskedPlace {
        let [left, right] = self.columns;
        let [from, to] = [
            masked.corner(self.rows[0], left),
            masked.corner(self.rows[1] + 1, right + 1),
        ];
        let perimeter_m = surface.perimeter_m();
        let degrees = |s_m: f64| {
            let s_m = s_m / scale;
            360.0 * s_m.div_euclid(perimeter_m) + surface.angle_rad(s_m).to_degrees()
        };
        let is_whole = right + 1 - left >= masked.columns();
        let from_deg = degrees(from.s_m).rem_euclid(360.0);
        MaskedPlace {
            chainage_from_m: from.h_m,
            chainage_to_m: to.h_m,
            angle_from_deg: if is_whole { 0.0 } else { from_deg },
            angle_to_deg: match is_whole {
                true => 360.0,
                false => from_deg + degrees(to.s_m) - degrees(from.s_m),
            },
            area_m2: self.tiles as f64 * masked.tile_m2(),
            left_out_share: self.left_out as f64 / self.frames.max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_core::survey::MaskedTile;
    use tunnelstitch_geometry::surface::Circle;

    /// Two places, one of them across θ = 0; tiles with fewer frames left out than half are none.
    #[test]
    fn places_are_connected_and_the_largest_is_first() {
        let circle = Circle::new(3.0).unwrap();
        let tile = |row, column, left_out| MaskedTile {
            row,
            column,
            frames: 4,
            left_out,
        };
        let tiles = vec![
            tile(0, 0, 3),
            tile(1, 35, 2),
            tile(2, 34, 2),
            tile(0, 10, 4),
            tile(0, 11, 1),
        ];
        let masked = MaskedWall::new(circle.perimeter_m(), (36, 0.1), vec![(0, 0, 36)], tiles);
        let report = MaskedReport::new(&masked, &circle, 1.0);
        let tile_m2 = masked.tile_m2();
        assert!((report.area_m2 - 4.0 * tile_m2).abs() < 1e-12);
        assert!((report.share - 4.0 / 36.0).abs() < 1e-12);
        let [large, small] = &report.places[..] else {
            panic!("{report:?}");
        };
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(is_near(large.angle_from_deg, 340.0) && is_near(large.angle_to_deg, 370.0));
        assert!(is_near(large.chainage_from_m, 0.0) && is_near(large.chainage_to_m, 0.3));
        assert!(is_near(large.left_out_share, 7.0 / 12.0));
        assert!(is_near(small.angle_from_deg, 100.0) && is_near(small.angle_to_deg, 110.0));
        assert!(is_near(small.area_m2, tile_m2));
    }
}
