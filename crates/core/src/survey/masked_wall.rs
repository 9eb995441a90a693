//! `masked.json`: the wall where frames show something else, so that `refine` has left them out.
//!
//! ```json
//! {
//!   "format": "wall-masked-1",
//!   "perimeter_m": 18.85, "columns": 620, "row_m": 0.0304,
//!   "origin": { "s_m": 0.0, "h_m": 0.0 },
//!   "seen": [[-3, 0, 620]],
//!   "tiles": [[-3, 17, 9, 4]]
//! }
//! ```
//!
//! The unrolled wall is divided into tiles, `columns` around (periodic) and `row_m` high; the tile
//! of row j and column i begins at `s_0 + i perimeter/columns` and `h_0 + j row_m`. `seen` has the
//! tiles that two frames or more see: row, first column, first column that is none. `tiles` has
//! those of them in which some frame was left out, ascending: row, column, number of frames that
//! see it, and how many of them were left out.

use super::error::SurveyError;
use super::wall_file::{check_format, check_origin, check_perimeter, read_wall_file};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tunnelstitch_geometry::surface::WallPoint;

/// Name of the file beside the poses.
pub const MASKED_FILE: &str = "masked.json";
/// Name and version of the format.
const FORMAT: &str = "wall-masked-1";

/// The content of `masked.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaskedWall {
    format: String,
    perimeter_m: f64,
    columns: i64,
    row_m: f64,
    origin: WallPoint,
    seen: Vec<(i64, i64, i64)>,
    tiles: Vec<MaskedTile>,
}

/// A tile of the wall in which some frame was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "(i64, i64, u32, u32)", into = "(i64, i64, u32, u32)")]
pub struct MaskedTile {
    /// Row along the tunnel.
    pub row: i64,
    /// Column around the section.
    pub column: i64,
    /// Number of frames that see it.
    pub frames: u32,
    /// Number of frames that were left out of it.
    pub left_out: u32,
}

impl From<(i64, i64, u32, u32)> for MaskedTile {
    fn from((row, column, frames, left_out): (i64, i64, u32, u32)) -> Self {
        Self {
            row,
            column,
            frames,
            left_out,
        }
    }
}

impl From<MaskedTile> for (i64, i64, u32, u32) {
    fn from(tile: MaskedTile) -> Self {
        (tile.row, tile.column, tile.frames, tile.left_out)
    }
}

impl MaskedTile {
    /// Share of the frames that were left out, 0 to 1.
    pub fn share(&self) -> f64 {
        f64::from(self.left_out) / f64::from(self.frames.max(1))
    }

    /// True if half of the frames or more were left out: what most of them show is not the wall.
    pub fn is_hidden(&self) -> bool {
        2 * u64::from(self.left_out) >= u64::from(self.frames)
    }
}

impl MaskedWall {
    /// The wall in tiles, `columns` around a section of the given perimeter and `row_m` high
    /// (metres); row 0 begins at the chainage 0. `seen`: row, first column, first column that is
    /// none, of the tiles that two frames or more see.
    pub fn new(
        perimeter_m: f64,
        (columns, row_m): (i64, f64),
        mut seen: Vec<(i64, i64, i64)>,
        mut tiles: Vec<MaskedTile>,
    ) -> Self {
        seen.sort_unstable();
        tiles.sort_unstable_by_key(|tile| (tile.row, tile.column));
        Self {
            format: FORMAT.to_owned(),
            perimeter_m,
            columns,
            row_m,
            origin: WallPoint::default(),
            seen,
            tiles,
        }
    }

    /// Reads a file for a tunnel of the given perimeter, metres.
    ///
    /// # Errors
    /// [`SurveyError::Value`] that names the file and what is wrong.
    pub fn read(path: &Path, perimeter_m: f64) -> Result<Self, SurveyError> {
        read_wall_file(path, "the masked wall", |file: &Self| {
            file.check(perimeter_m)
        })
    }

    /// Reads the file beside another one, such as that of the poses; None if there is none.
    ///
    /// # Errors
    /// As [`MaskedWall::read`].
    pub fn read_beside(file: &Path, perimeter_m: f64) -> Result<Option<Self>, SurveyError> {
        let path = file.with_file_name(MASKED_FILE);
        path.is_file()
            .then(|| Self::read(&path, perimeter_m))
            .transpose()
    }

    /// Checks all values; returns what is wrong.
    fn check(&self, perimeter_m: f64) -> Result<(), String> {
        check_format(&self.format, FORMAT)?;
        let sizes = [
            ("perimeter_m", self.perimeter_m),
            ("columns", self.columns as f64),
            ("row_m", self.row_m),
        ];
        if let Some((name, size)) = (sizes.iter()).find(|(_, s)| !(s.is_finite() && *s > 0.0)) {
            return Err(format!("{name} is {size}; it must be positive"));
        }
        check_perimeter(self.perimeter_m, perimeter_m, "the masked wall")?;
        check_origin(self.origin)?;
        if let Some((row, from, to)) = (self.seen.iter())
            .find(|(_, from, to)| !(0 <= *from && from < to && *to <= self.columns))
        {
            return Err(format!(
                "seen has the columns {from} to {to} in row {row}; there are {}",
                self.columns
            ));
        }
        for (k, tile) in self.tiles.iter().enumerate() {
            let is_inside = (0..self.columns).contains(&tile.column);
            let is_possible = (1..=tile.frames).contains(&tile.left_out);
            if !(is_inside && is_possible) {
                return Err(format!(
                    "tile {k} is {:?}; its column must be below {}, and of its frames at least one \
                     left out",
                    <(i64, i64, u32, u32)>::from(*tile),
                    self.columns
                ));
            }
        }
        if !(self.tiles.is_sorted_by_key(|tile| (tile.row, tile.column)) && self.seen.is_sorted()) {
            return Err("tiles or seen are not in ascending order".to_owned());
        }
        Ok(())
    }

    /// The wall moved on the unrolled wall and then scaled with all of it.
    pub fn moved(self, by: WallPoint, scale: f64) -> Self {
        Self {
            perimeter_m: self.perimeter_m * scale,
            row_m: self.row_m * scale,
            origin: WallPoint {
                s_m: (self.origin.s_m + by.s_m) * scale,
                h_m: (self.origin.h_m + by.h_m) * scale,
            },
            ..self
        }
    }

    /// The tiles in which some frame was left out, ascending by row and column.
    pub fn tiles(&self) -> &[MaskedTile] {
        &self.tiles
    }

    /// Number of tiles around the section.
    pub fn columns(&self) -> i64 {
        self.columns
    }

    /// The tiles that two frames or more see: row, first column, first column that is none.
    pub fn seen(&self) -> &[(i64, i64, i64)] {
        &self.seen
    }

    /// Area of the wall that two frames or more see, square metres.
    pub fn seen_m2(&self) -> f64 {
        let tiles: i64 = self.seen.iter().map(|(_, from, to)| to - from).sum();
        tiles as f64 * self.tile_m2()
    }

    /// Area of a tile, square metres.
    pub fn tile_m2(&self) -> f64 {
        let [width_m, height_m] = self.tile_size_m();
        width_m * height_m
    }

    /// Width and height of a tile, metres.
    pub fn tile_size_m(&self) -> [f64; 2] {
        [self.perimeter_m / self.columns as f64, self.row_m]
    }

    /// Beginning of a tile, around and along, metres. Columns may be counted on beyond the last.
    pub fn corner(&self, row: i64, column: i64) -> WallPoint {
        let [width_m, height_m] = self.tile_size_m();
        WallPoint {
            s_m: self.origin.s_m + column as f64 * width_m,
            h_m: self.origin.h_m + row as f64 * height_m,
        }
    }

    /// Share of the frames that were left out at a point, 0 to 1; None where no two frames see it.
    pub fn share_at(&self, wall: WallPoint) -> Option<f64> {
        let (row, column) = self.place_of(wall);
        let after = self
            .seen
            .partition_point(|(r, from, _)| (*r, *from) <= (row, column));
        let (found, _, to) = self.seen[..after].last()?;
        let is_seen = *found == row && column < *to;
        let tile = self.index(row, column).map(|k| self.tiles[k]);
        is_seen.then(|| tile.map_or(0.0, |tile| tile.share()))
    }

    /// True where half of the frames that see a point or more were left out.
    pub fn is_hidden_at(&self, wall: WallPoint) -> bool {
        let (row, column) = self.place_of(wall);
        (self.index(row, column)).is_some_and(|k| self.tiles[k].is_hidden())
    }

    /// Row and column of the tile of a point.
    fn place_of(&self, wall: WallPoint) -> (i64, i64) {
        let [width_m, height_m] = self.tile_size_m();
        let column = ((wall.s_m - self.origin.s_m) / width_m).floor() as i64;
        let row = ((wall.h_m - self.origin.h_m) / height_m).floor() as i64;
        (row, column.rem_euclid(self.columns))
    }

    /// Index of the tile of a row and column in [`MaskedWall::tiles`], if some frame was left out
    /// there.
    pub fn index(&self, row: i64, column: i64) -> Option<usize> {
        let tiles = &self.tiles;
        let found = tiles.binary_search_by_key(&(row, column), |tile| (tile.row, tile.column));
        found.ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn masked() -> MaskedWall {
        let tile = |row, column, left_out| MaskedTile {
            row,
            column,
            frames: 4,
            left_out,
        };
        let tiles = vec![tile(2, 3, 1), tile(-1, 7, 4), tile(2, 0, 2)];
        MaskedWall::new(8.0, (8, 0.5), vec![(2, 0, 5), (-1, 6, 8), (2, 6, 7)], tiles)
    }

    /// Shares by place, across the end of the section; beyond what is seen there are none.
    #[test]
    fn shares_are_found_by_place() {
        let masked = masked().moved(WallPoint { s_m: 0.5, h_m: 1.0 }, 2.0);
        assert_eq!(masked.tile_size_m(), [2.0, 1.0]);
        let at = |row: f64, column: f64| {
            let wall = WallPoint {
                s_m: 1.0 + 2.0 * column,
                h_m: 2.0 + row,
            };
            (masked.share_at(wall), masked.is_hidden_at(wall))
        };
        assert_eq!(at(2.5, 3.5), (Some(0.25), false));
        assert_eq!(at(2.5, 8.5), (Some(0.5), true));
        assert_eq!(at(-0.5, 7.5), (Some(1.0), true));
        assert_eq!(at(-0.5, -0.5), (Some(1.0), true));
        assert_eq!(at(2.5, 6.5), (Some(0.0), false));
        for (row, column) in [(2.5, 5.5), (2.5, 7.5), (1.5, 3.5), (-0.5, 5.5), (3.5, 0.5)] {
            assert_eq!(at(row, column), (None, false), "{row} {column}");
        }
        assert_eq!(masked.seen_m2(), 16.0);
    }

    #[test]
    fn a_written_file_is_read_back_and_impossible_values_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(MASKED_FILE);
        std::fs::write(&path, serde_json::to_string(&masked()).unwrap()).unwrap();
        assert_eq!(MaskedWall::read(&path, 8.0).unwrap(), masked());
        type Change = fn(&mut MaskedWall);
        let changes: [(Change, &str); 7] = [
            (|m| m.format = "x".to_owned(), "format"),
            (|m| m.perimeter_m = 9.0, "another tunnel"),
            (|m| m.row_m = 0.0, "row_m"),
            (|m| m.origin.s_m = f64::NAN, "origin"),
            (|m| m.seen[1].2 = 9, "seen"),
            (|m| m.tiles[0].left_out = 5, "left out"),
            (|m| m.tiles.reverse(), "order"),
        ];
        for (change, named) in changes {
            let mut masked = masked();
            change(&mut masked);
            let error = masked.check(8.0).unwrap_err();
            assert!(error.contains(named), "{error}");
        }
    }
}
