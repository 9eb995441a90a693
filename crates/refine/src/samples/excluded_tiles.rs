//! Tiles of the wall from which the outlier mask has excluded frames.

use crate::samples::observer_marks::ObserverMarks;
use crate::samples::visibility::Visibility;
use crate::tiles::grid::WallGrid;
use tunnelstitch_core::survey::{MaskedTile, MaskedWall};

/// The tiles with an excluded frame, and the number of all tiles.
#[derive(Clone, Debug, Default)]
pub struct ExcludedTiles {
    /// Row, first column, first column that is none, of the tiles that two frames or more observe.
    seen: Vec<(i64, i64, i64)>,
    tiles: Vec<MaskedTile>,
}

impl ExcludedTiles {
    /// Counts the observers of every tile of a stretch before the marked ones are excluded.
    pub fn add(&mut self, visibility: &Visibility, marks: &ObserverMarks) {
        let places = visibility.tiles.iter();
        let mut places: Vec<(i64, i64)> =
            places.map(|tile| (tile.id.row, tile.id.column)).collect();
        places.sort_unstable();
        let runs = places.chunk_by(|(row, column), next| *next == (*row, column + 1));
        self.seen.extend(runs.map(|run| {
            let (row, from) = run[0];
            (row, from, from + run.len() as i64)
        }));
        let tiles = visibility.tiles.iter().map(|tile| MaskedTile {
            row: tile.id.row,
            column: tile.id.column,
            frames: tile.observers.len() as u32,
            left_out: tile.observers.clone().filter(|k| marks.has(*k)).count() as u32,
        });
        self.tiles.extend(tiles.filter(|tile| tile.left_out > 0));
    }

    /// The tiles on the wall of the given perimeter, metres, that `grid` divides.
    pub fn masked_wall(&self, grid: &WallGrid, perimeter_m: f64) -> MaskedWall {
        let (_, row_m) = grid.tile_size_m();
        MaskedWall::new(
            perimeter_m,
            (grid.columns, row_m),
            self.seen.clone(),
            self.tiles.clone(),
        )
    }
}
