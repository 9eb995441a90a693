//! Selection of the most informative tiles.
//!
//! Most of a wall carries little information on poses: a tile's part of the normal matrix grows
//! with the squared slopes of its texture, and edges are few. A solve that only has to come close
//! uses as many of the most informative tiles as hold a given share of the information. They are
//! selected block by block, so that every frame keeps tiles all over its image, which the six
//! parameters of its pose need; and in both directions, by the score
//! `½ (Σ (∂S/∂s)² / Σ_block + Σ (∂S/∂h)² / Σ_block)`. Otherwise the joints between courses of
//! bricks, longer than those across, would be all that is left.
//!
//! The last solve uses all tiles. With a share f of the information its error would grow by more
//! than the factor `1/√f` of independent noise: frames also differ in blur and interpolation, which
//! leaves residuals proportional to the texture's curvature. Their products with its slope,
//! `S″ S′ = (S′²)′/2`, cancel over the whole wall, but not at the borders of the selected tiles.
//!
//! The slopes are those of one image, of the frame with most pixels of the tile. Its noise does not
//! bias the solve, as its sign is random; it makes tiles more alike, so that more of them are kept.

use crate::samples::visibility::{Tile, Visibility};
use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::grid::{TilePoints, WallGrid};
use crate::tiles::tile_statistics::squared_slopes;
use std::ops::Range;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::surface::Surface;

/// Selects the most informative tiles of each block until they hold the share `information` of its
/// information.
pub fn select_most_informative(
    visibility: &Visibility,
    information: f64,
    grid: &WallGrid,
    surface: &dyn Surface,
    frames: &[SampledFrame],
) -> Visibility {
    let kept: Vec<Vec<usize>> = visibility.blocks.par_map(|block| {
        let squares = squared_slopes_of_tiles(visibility, block, grid, surface, frames);
        find_best(&squares, information)
            .into_iter()
            .map(|k| block.start + k)
            .collect()
    });
    visibility.restrict_to(&kept)
}

/// Squared slopes along s and h of each tile of a block.
fn squared_slopes_of_tiles(
    visibility: &Visibility,
    block: &Range<usize>,
    grid: &WallGrid,
    surface: &dyn Surface,
    frames: &[SampledFrame],
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
            let frame = &frames[nearest.frame as usize];
            let squares = dispatch_simd(
                #[inline(always)]
                || squared_slopes(&points, frame, nearest.shade),
            );
            // A tile with gaps in the image counts as uninformative.
            squares.map(|square| if square.is_nan() { 0.0 } else { square })
        })
        .collect()
}

/// Indices, ascending, of the best tiles that together hold a share of the information.
fn find_best(squares: &[[f64; 2]], information: f64) -> Vec<usize> {
    let total = squares
        .iter()
        .fold([1e-12; 2], |sum, [s, h]| [sum[0] + s, sum[1] + h]);
    let scores: Vec<f64> = squares
        .iter()
        .map(|[s, h]| 0.5 * (s / total[0] + h / total[1]))
        .collect();
    let mut order: Vec<usize> = (0..squares.len()).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]));
    let mut held = 0.0;
    order.retain(|k| {
        let is_needed = held < information;
        held += scores[*k];
        is_needed
    });
    order.sort_unstable();
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_directions_count_equally() {
        // Scores 0.25, 0.22, 0.34, 0.03, 0.17.
        let squares = [[9.0, 0.0], [8.0, 0.0], [0.1, 0.2], [1.0, 0.0], [0.0, 0.1]];
        assert_eq!(find_best(&squares, 0.3), [2]);
        assert_eq!(find_best(&squares, 0.8), [0, 1, 2]);
        assert_eq!(find_best(&squares, 1.1), [0, 1, 2, 3, 4]);
    }
}
