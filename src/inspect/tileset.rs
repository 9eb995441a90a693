//! Tree of a tileset: OGC 3D Tiles 1.1, explicit tiling.
//!
//! Levels are those of the panorama's pyramid; a tile has up to four children of half its size
//! that replace it. Coordinates are those of the world: 3D Tiles has z up, too, and converts the
//! axes of glTF.
//!
//! **Geometric error.** Coarse tiles lack resolution. Programs refine a tile whose error on the
//! screen exceeds some 16 pixels, so the error of a tile is [`SCREEN_PX`] pixels of its texture, in
//! metres: then a pixel of the texture covers at most one of the screen. The finest tiles have
//! error 0.

use nalgebra::Vector3;
use serde_json::{Value, json};
use std::collections::HashMap;
use tunnelstitch_core::PROGRAM;

/// The error on the screen at which programs refine by default, pixels.
pub(super) const SCREEN_PX: f64 = 16.0;

/// Levels per file, which has at most 4⁰ + … + 4⁴ tiles, so that the tree is streamed as well.
const LEVELS_PER_FILE: usize = 5;

/// Key of a tile: level (0 is the finest), column and row.
pub(super) type TileKey = (usize, u32, u32);

/// Tree of the written tiles.
pub(super) struct TileTree<'a> {
    /// Pixels per metre of the finest level.
    pub(super) px_per_metre: f64,
    /// Number of columns and rows of tiles of each level.
    pub(super) grids: Vec<[u32; 2]>,
    /// Bounding box of each tile's mesh in the world, metres.
    pub(super) bounds_m: &'a HashMap<TileKey, [Vector3<f64>; 2]>,
}

/// Name of a tile's content file.
pub(super) fn content_name((level, column, row): TileKey) -> String {
    format!("{level}/{column}_{row}.glb")
}

/// Name of the file of the tree below a tile.
fn file_name((level, column, row): TileKey) -> String {
    format!("{level}_{column}_{row}.json")
}

/// Name of the file that holds the root of the tree of tiles.
pub const TILESET: &str = "tileset.json";

impl TileTree<'_> {
    /// All files of the tree, with their names.
    pub(super) fn files(&self) -> Vec<(String, Value)> {
        let root = (self.grids.len() - 1, 0, 0);
        let mut files = Vec::new();
        let (tile, _) = self.tile(root, &mut files);
        files.push((TILESET.to_owned(), self.file(root, tile)));
        files
    }

    /// A file of the tree with the given root.
    fn file(&self, (level, ..): TileKey, root: Value) -> Value {
        // Error of the missing root: that of one more level.
        let error_m = self.error_m(level + 1);
        json!({
            "asset": { "version": "1.1", "extras": { "generator": PROGRAM } },
            "geometricError": error_m,
            "root": root,
        })
    }

    /// Geometric error of a level, metres.
    fn error_m(&self, level: usize) -> f64 {
        match level {
            0 => 0.0,
            _ => SCREEN_PX * 2f64.powi(level as i32) / self.px_per_metre,
        }
    }

    /// A tile with its subtree, and their bounding box; adds the files of deeper parts to `files`.
    fn tile(&self, key: TileKey, files: &mut Vec<(String, Value)>) -> (Value, [Vector3<f64>; 2]) {
        let (level, column, row) = key;
        let mut bounds = self.bounds_m.get(&key).copied().unwrap_or_default();
        let mut children = Vec::new();
        for key in self.children(level, column, row) {
            let (child, [low, high]) = self.tile(key, files);
            bounds = [bounds[0].inf(&low), bounds[1].sup(&high)];
            children.push(self.split_file(key, child, files));
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

    /// The tile itself, or a reference to the file into which it is moved.
    fn split_file(&self, key: TileKey, tile: Value, files: &mut Vec<(String, Value)>) -> Value {
        if key.0 % LEVELS_PER_FILE != LEVELS_PER_FILE - 1 {
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

    /// Keys of the children of a tile.
    fn children(&self, level: usize, column: u32, row: u32) -> impl Iterator<Item = TileKey> {
        let below = level.checked_sub(1);
        let grid = below.map_or([0, 0], |below| self.grids[below]);
        [[0, 0], [1, 0], [0, 1], [1, 1]]
            .into_iter()
            .map(move |[right, down]| [2 * column + right, 2 * row + down])
            .filter(move |place| place[0] < grid[0] && place[1] < grid[1])
            .filter_map(move |[column, row]| Some((below?, column, row)))
    }
}

/// Oriented box (centre and half axes) with a margin for the rounding of vertices.
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
