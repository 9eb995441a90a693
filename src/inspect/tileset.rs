//! The tree of a tileset: OGC 3D Tiles 1.1, explicit tiling.
//!
//! Levels are those of the panorama's pyramid, and a tile has up to four children of half its size
//! on the wall that replace it. Coordinates are the world's: 3D Tiles has z up as the world has,
//! and turns glTF's axes by itself.
//!
//! **Geometric error.** What a tile lacks is sharpness. Programs refine a tile whose error seems
//! larger than some 16 pixels, so the error of a tile is [`SCREEN_PX`] of its texture's pixels, in
//! metres: then a pixel of it fills at most one of the screen. The finest tiles have no error.

use crate::PROGRAM;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::collections::HashMap;

/// The error on the screen at which programs refine by default, pixels.
pub(super) const SCREEN_PX: f64 = 16.0;

/// Levels of one file: a file has at most 4⁰ + … + 4⁴ tiles, so that a long tunnel streams its
/// tree, too.
const LEVELS_A_FILE: usize = 5;

/// Level (0 is the finest), column and row.
pub(super) type Key = (usize, u32, u32);

/// The tiles that were written.
pub(super) struct Tree<'a> {
    /// Pixels per metre of the finest level.
    pub(super) px_per_metre: f64,
    /// Columns and rows of tiles, level by level.
    pub(super) grids: Vec<[u32; 2]>,
    /// The least and largest coordinates of each tile's own triangles, world, metres.
    pub(super) bounds_m: &'a HashMap<Key, [Vector3<f64>; 2]>,
}

/// The name of a tile's content.
pub(super) fn content_name((level, column, row): Key) -> String {
    format!("{level}/{column}_{row}.glb")
}

/// The name of the file of the tree below a tile.
fn file_name((level, column, row): Key) -> String {
    format!("{level}_{column}_{row}.json")
}

/// Name of the file that holds the root of the tree of tiles.
pub const TILESET: &str = "tileset.json";

impl Tree<'_> {
    /// All files of the tree, by name.
    pub(super) fn files(&self) -> Vec<(String, Value)> {
        let root = (self.grids.len() - 1, 0, 0);
        let mut files = Vec::new();
        let (tile, _) = self.tile(root, &mut files);
        files.push((TILESET.to_owned(), self.file(root, tile)));
        files
    }

    fn file(&self, (level, ..): Key, root: Value) -> Value {
        // What is wrong where nothing is drawn: as much as one level more.
        let error_m = self.error_m(level + 1);
        json!({
            "asset": { "version": "1.1", "extras": { "generator": PROGRAM } },
            "geometricError": error_m,
            "root": root,
        })
    }

    fn error_m(&self, level: usize) -> f64 {
        match level {
            0 => 0.0,
            _ => SCREEN_PX * 2f64.powi(level as i32) / self.px_per_metre,
        }
    }

    /// A tile and all below it; the least and largest coordinates of all that. Files of deeper
    /// parts are added to `files`.
    fn tile(&self, key: Key, files: &mut Vec<(String, Value)>) -> (Value, [Vector3<f64>; 2]) {
        let (level, column, row) = key;
        let mut bounds = self.bounds_m.get(&key).copied().unwrap_or_default();
        let mut children = Vec::new();
        for key in self.children(level, column, row) {
            let (child, [low, high]) = self.tile(key, files);
            bounds = [bounds[0].inf(&low), bounds[1].sup(&high)];
            children.push(self.within_a_file(key, child, files));
        }
        let mut tile = json!({
            "boundingVolume": { "box": oriented_box(&bounds) },
            "geometricError": self.error_m(level),
            "refine": "REPLACE",
            "content": { "uri": content_name(key) },
        });
        if !children.is_empty() {
            tile["children"] = children.into();
        }
        (tile, bounds)
    }

    /// The tile itself, or one that stands for the file that it was moved into.
    fn within_a_file(&self, key: Key, tile: Value, files: &mut Vec<(String, Value)>) -> Value {
        if key.0 % LEVELS_A_FILE != LEVELS_A_FILE - 1 {
            return tile;
        }
        let reference = json!({
            "boundingVolume": tile["boundingVolume"],
            "geometricError": tile["geometricError"],
            "refine": "REPLACE",
            "content": { "uri": file_name(key) },
        });
        files.push((file_name(key), self.file(key, tile)));
        reference
    }

    fn children(&self, level: usize, column: u32, row: u32) -> impl Iterator<Item = Key> {
        let below = level.checked_sub(1);
        let grid = below.map_or([0, 0], |below| self.grids[below]);
        [[0, 0], [1, 0], [0, 1], [1, 1]]
            .into_iter()
            .map(move |[right, down]| [2 * column + right, 2 * row + down])
            .filter(move |place| place[0] < grid[0] && place[1] < grid[1])
            .filter_map(move |[column, row]| Some((below?, column, row)))
    }
}

/// Centre and half axes, a little larger than the triangles, whose numbers are rounded.
fn oriented_box([low, high]: &[Vector3<f64>; 2]) -> Vec<f64> {
    const MARGIN_M: f64 = 1e-4;
    let (centre, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let axis = |k: usize| Vector3::ith(k, half[k] + MARGIN_M);
    let vectors = [centre, axis(0), axis(1), axis(2)];
    vectors
        .iter()
        .flat_map(|vector| vector.iter().copied())
        .collect()
}
