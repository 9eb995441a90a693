//! Choosing wall samples by information.
//!
//! Most of a wall says little about poses: a tile's share of the normal matrix goes with the
//! squared slopes of its texture, and edges are few. So a solve that only has to come close may do
//! with the most informative tiles: as many as hold a given share of the information. They are
//! chosen block by block, so that every frame keeps tiles all over its picture, as all six unknowns
//! of its pose need; and in either direction, by `Σ (∂S/∂s)² / Σ_block + Σ (∂S/∂h)² / Σ_block`,
//! lest the joints between the courses of bricks, longer than those across, be all that is left.
//!
//! Not for the last solve: with a share f of the information its error would be more than the
//! `1/√f` times as large that counting noise alone would have it. Frames also differ in blur and
//! interpolation, which leaves residuals that go with the texture's curvature; their products with
//! its slope, `S″ S′ = (S′²)′/2`, cancel over the whole of a wall, but not at the seams of a
//! patchwork.
//!
//! The slopes are those in one picture, of the frame that shows most of the tile. Its noise does
//! not bias the solve, being as likely to have either sign; it makes tiles look more alike than
//! they are, so that more of them are kept.

use crate::numerics::simd_dispatch::dispatch_simd;
use crate::refine::samples::visibility::{Tile, Visibility};
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::{TilePoints, WallGrid};
use crate::refine::tiles::tile::slope_squares;
use crate::surface::Surface;
use rayon::prelude::*;
use std::ops::Range;

/// The best tiles of each block, as many as hold a share `information` of what all of it tells.
pub fn most_informative(
    visibility: &Visibility,
    information: f64,
    grid: &WallGrid,
    surface: &dyn Surface,
    views: &[SampledFrame],
) -> Visibility {
    let kept: Vec<Vec<usize>> = visibility
        .blocks
        .par_iter()
        .map(|block| {
            let squares = squares(visibility, block, grid, surface, views);
            best(&squares, information)
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
    views: &[SampledFrame],
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
            let squares = dispatch_simd(
                #[inline(always)]
                || slope_squares(&points, view, nearest.shade),
            );
            // A tile with gaps in the picture tells nothing.
            squares.map(|square| if square.is_nan() { 0.0 } else { square })
        })
        .collect()
}

/// The places of the best tiles that together hold a share of the information, ascending.
fn best(squares: &[[f64; 2]], information: f64) -> Vec<usize> {
    let all = squares
        .iter()
        .fold([1e-12; 2], |sum, [s, h]| [sum[0] + s, sum[1] + h]);
    let scores: Vec<f64> = squares
        .iter()
        .map(|[s, h]| 0.5 * (s / all[0] + h / all[1]))
        .collect();
    let mut order: Vec<usize> = (0..squares.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
    let mut held = 0.0;
    order.retain(|k| {
        let wanted = held < information;
        held += scores[*k];
        wanted
    });
    order.sort_unstable();
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_directions_count_however_weak() {
        // Scores 0.25, 0.22, 0.34, 0.03, 0.17.
        let squares = [[9.0, 0.0], [8.0, 0.0], [0.1, 0.2], [1.0, 0.0], [0.0, 0.1]];
        assert_eq!(best(&squares, 0.3), [2]);
        assert_eq!(best(&squares, 0.8), [0, 1, 2]);
        assert_eq!(best(&squares, 1.1), [0, 1, 2, 3, 4]);
    }
}
