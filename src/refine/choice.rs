//! Choosing wall samples by information.
//!
//! Most of a wall says little about poses: a tile's share of the normal matrix goes with the squared slopes of its
//! texture, and edges are few. So a solve may do with the most informative tiles. They are chosen block by block, a fixed
//! share of each, so that every frame keeps tiles all over its picture, as all six unknowns of its pose need; and
//! in either direction, by `Σ (∂S/∂s)² / Σ_block + Σ (∂S/∂h)² / Σ_block`, lest the joints between the courses of
//! bricks, longer than those across, be all that is left.
//!
//! The slopes are those in one picture, of the frame that shows most of the tile. Its noise makes the choice a little worse
//! but does not bias the solve: it is as likely to have either sign.

use super::grid::{TilePoints, WallGrid};
use super::tile::slope_squares;
use super::view::View;
use super::visibility::{Tile, Visibility};
use crate::surface::Surface;
use crate::vectors::wide;
use rayon::prelude::*;
use std::ops::Range;

/// The `share` of the tiles of each block that tells most.
pub fn most_informative(
    visibility: &Visibility,
    share: f64,
    grid: &WallGrid,
    surface: &dyn Surface,
    views: &[View],
) -> Visibility {
    let kept: Vec<Vec<usize>> = visibility
        .blocks
        .par_iter()
        .map(|block| {
            let squares = squares(visibility, block, grid, surface, views);
            let count = (share * block.len() as f64).ceil() as usize;
            best(&squares, count)
                .into_iter()
                .map(|k| block.start + k)
                .collect()
        })
        .collect();
    visibility.only(&kept)
}

/// Squared slopes along s and h of each tile of a block.
fn squares(
    visibility: &Visibility,
    block: &Range<usize>,
    grid: &WallGrid,
    surface: &dyn Surface,
    views: &[View],
) -> Vec<[f64; 2]> {
    let mut scratch = Vec::new();
    let tiles = visibility.tiles[block.clone()].iter();
    tiles
        .map(|tile: &Tile| {
            let points = TilePoints::new(grid, surface, tile.id, &mut scratch);
            let observers = visibility.observers(tile).iter();
            let Some(nearest) = observers.max_by(|a, b| a.pixels.total_cmp(&b.pixels)) else {
                return [0.0; 2];
            };
            let view = &views[nearest.frame as usize];
            let squares = wide(
                #[inline(always)]
                || slope_squares(&points, view, nearest.shade),
            );
            // A tile with gaps in the picture tells nothing.
            squares.map(|square| if square.is_nan() { 0.0 } else { square })
        })
        .collect()
}

/// The places of the `count` best tiles, ascending.
fn best(squares: &[[f64; 2]], count: usize) -> Vec<usize> {
    let all = squares
        .iter()
        .fold([1e-12; 2], |sum, [s, h]| [sum[0] + s, sum[1] + h]);
    let score = |k: &usize| squares[*k][0] / all[0] + squares[*k][1] / all[1];
    let mut order: Vec<usize> = (0..squares.len()).collect();
    order.sort_by(|a, b| score(b).total_cmp(&score(a)));
    order.truncate(count);
    order.sort_unstable();
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_directions_count_however_weak() {
        let squares = [[9.0, 0.0], [8.0, 0.0], [0.1, 0.2], [1.0, 0.0], [0.0, 0.1]];
        assert_eq!(best(&squares, 1), [2]);
        assert_eq!(best(&squares, 3), [0, 1, 2]);
        assert_eq!(best(&squares, 9), [0, 1, 2, 3, 4]);
    }
}
