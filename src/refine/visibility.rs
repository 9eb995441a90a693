//! Which frames see which tiles of the wall.

use super::grid::{SIDE, TileId, WallGrid};
use crate::camera::Pinhole;
use crate::surface::{Footprint, Surface, SurfaceError};
use crate::trajectory::Pose;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::ops::Range;

/// Pixels that a tile must stay away from the frame's border: room for the steps to come.
const MARGIN_PX: f64 = 1.0;

/// Area of a tile between its outermost samples, in samples.
const SAMPLES_BETWEEN_CORNERS: f64 = ((SIDE - 1) * (SIDE - 1)) as f64;

/// A frame that sees all of a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Index of the frame.
    pub frame: usize,
    /// Pixels that a sample of the tile stands for in this frame, q: the weight that makes every pixel count
    /// once, however obliquely it sees the wall. It stays as it is while the poses move; otherwise a step could
    /// lower the cost by looking at the wall more obliquely.
    pub pixels: f32,
}

/// A tile and the frames that see all of it.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Which tile.
    pub id: TileId,
    /// Where its observers stand in [`Visibility::observers`].
    pub observers: Range<usize>,
}

/// The observations of a set of frames: every tile that at least two frames see, one of them active.
///
/// A frame either sees a whole tile (with the ring its gradients need) or does not count there at all: no
/// mask is needed, every sample of a tile averages the same frames, and the set stays the same while the
/// poses move, so that costs before and after a step are of the same points.
#[derive(Clone, Debug)]
pub struct Visibility {
    /// Tiles, block by block.
    pub tiles: Vec<Tile>,
    /// Observers, ascending by frame within a tile.
    pub observers: Vec<Observer>,
    /// Runs of tiles of one block: the units of parallel work.
    pub blocks: Vec<Range<usize>>,
}

impl Visibility {
    /// Finds the tiles that `poses` see; `active` are the frames to be estimated. Frames are counted from
    /// the first of `poses`.
    ///
    /// # Errors
    /// The first frame that does not go with the tunnel.
    pub fn find(
        surface: &dyn Surface,
        grid: &WallGrid,
        camera: &Pinhole,
        poses: &[Pose],
        active: &Range<usize>,
    ) -> Result<Self, (usize, SurfaceError)> {
        let seen: Vec<Vec<(TileId, f32)>> = poses
            .par_iter()
            .enumerate()
            .map(|(k, pose)| {
                tiles_of_frame(surface, grid, camera, pose).map_err(|error| (k, error))
            })
            .collect::<Result<_, _>>()?;
        let mut pairs: Vec<((i64, i64, i64, i64), Observer)> = seen
            .iter()
            .enumerate()
            .flat_map(|(frame, tiles)| {
                let observe = move |(tile, pixels): &(TileId, f32)| {
                    let pixels = *pixels;
                    (tile.key(), Observer { frame, pixels })
                };
                tiles.iter().map(observe)
            })
            .collect();
        pairs.par_sort_unstable_by_key(|(key, observer)| (*key, observer.frame));

        let mut visibility = Self {
            tiles: Vec::new(),
            observers: Vec::new(),
            blocks: Vec::new(),
        };
        for group in pairs.chunk_by(|a, b| a.0 == b.0) {
            if group.len() < 2 || !group.iter().any(|(_, o)| active.contains(&o.frame)) {
                continue;
            }
            let (_, _, row, column) = group[0].0;
            let start = visibility.observers.len();
            visibility.observers.extend(group.iter().map(|(_, o)| *o));
            visibility.tiles.push(Tile {
                id: TileId { column, row },
                observers: start..visibility.observers.len(),
            });
        }
        let mut start = 0;
        for run in visibility
            .tiles
            .chunk_by(|a, b| a.id.block() == b.id.block())
        {
            visibility.blocks.push(start..start + run.len());
            start += run.len();
        }
        Ok(visibility)
    }

    /// The frames that see `tile`.
    pub fn observers(&self, tile: &Tile) -> &[Observer] {
        &self.observers[tile.observers.clone()]
    }
}

/// The tiles that a frame sees, with the pixels a sample stands for.
fn tiles_of_frame(
    surface: &dyn Surface,
    grid: &WallGrid,
    camera: &Pinhole,
    pose: &Pose,
) -> Result<Vec<(TileId, f32)>, SurfaceError> {
    let footprint = Footprint::trace(surface, camera, pose)?;
    let (width, height) = grid.tile_size_m();
    let first_column = (footprint.s_min_m / width).floor() as i64;
    let last_column =
        ((footprint.s_max_m / width).floor() as i64).min(first_column + grid.columns - 1);
    let first_row = (footprint.h_min_m / height).floor() as i64;
    let last_row = (footprint.h_max_m / height).floor() as i64;
    let pixel = |x_w: &Vector3<f64>| {
        camera
            .project(&pose.to_camera(x_w))
            .filter(|pixel| camera.sees(pixel, MARGIN_PX))
    };
    let mut tiles = Vec::new();
    let mut corners = Vec::new();
    for row in first_row..=last_row {
        for column in first_column..=last_column {
            let tile = TileId {
                column: column.rem_euclid(grid.columns),
                row,
            };
            grid.corners(surface, tile, &mut corners);
            if let [Some(a), Some(b), Some(c), Some(d)] = [0, 1, 2, 3].map(|k| pixel(&corners[k])) {
                // Half the cross product of the diagonals; the corners come row by row.
                let area = 0.5 * (d - a).perp(&(c - b)).abs();
                tiles.push((tile, (area / SAMPLES_BETWEEN_CORNERS) as f32));
            }
        }
    }
    Ok(tiles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Circle;
    use crate::trajectory::spiral;

    #[test]
    fn every_tile_is_seen_by_an_active_frame_and_another() {
        let circle = Circle::new(3.0).unwrap();
        let camera = Pinhole::from_vertical_fov(160, 120, 60f64.to_radians());
        let grid = WallGrid::new(&circle, 3.0 / camera.fy);
        let poses = spiral(24, 0.1, 30f64.to_radians());
        let active = 20..24;
        let found = Visibility::find(&circle, &grid, &camera, &poses, &active).unwrap();
        assert!(!found.tiles.is_empty());
        for tile in &found.tiles {
            let observers = found.observers(tile);
            assert!(observers.len() >= 2);
            assert!(
                observers
                    .windows(2)
                    .all(|pair| pair[0].frame < pair[1].frame)
            );
            // At about the distance the grid was made for, a sample is about a pixel.
            assert!(observers.iter().all(|o| (0.4..2.0).contains(&o.pixels)));
            assert!(observers.iter().any(|o| active.contains(&o.frame)));
        }
        let tiles: usize = found.blocks.iter().map(|block| block.len()).sum();
        assert_eq!(tiles, found.tiles.len());
    }
}
