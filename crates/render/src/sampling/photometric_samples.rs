//! Observations of single wall points by the frames, for their photometric calibration.

use super::point_batch::PointBatch;
use super::thumbnails::Thumbnails;
use crate::layout::canvas::Canvas;
use crate::layout::placement::Placement;
use crate::layout::tiles::{EDGE, Tile, tiles};
use crate::warp::projection::LocalPoints;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_photometry::{Observation, ObservedPoint};

/// Observes the points of `grid` that at least two frames show in the thumbnails, with nothing
/// known of gain, bias and shading.
pub fn observe_points(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    placements: &[Placement],
    grid: &Canvas,
) -> Vec<ObservedPoint> {
    let bands = tiles(surface, grid, placements, EDGE);
    let tiles: Vec<Tile> = bands.into_iter().flatten().collect();
    let found = tiles.par_map(|tile| observe_tile(surface, thumbnails, placements, grid, tile));
    found.into_iter().flatten().collect()
}

/// Observes the points of one tile of `grid`.
fn observe_tile(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    placements: &[Placement],
    grid: &Canvas,
    tile: &Tile,
) -> Vec<ObservedPoint> {
    let points = LocalPoints::new(&tile.points(surface, grid));
    let mut found: Vec<Vec<Observation>> = vec![Vec::new(); tile.pixels()];
    let columns = tile.columns as usize;
    let mut batch = PointBatch::default();
    for &frame in &tile.frames {
        let view = thumbnails.view(frame, &placements[frame], &points);
        for row in 0..tile.rows as usize {
            view.look_at(&mut batch, row * columns, columns);
            let (u, v) = batch.pixels();
            for k in 0..columns {
                if !batch.seen()[k] {
                    continue;
                }
                let grey = thumbnails.format().grey(batch.values()[k]);
                let pixel = [u[k], v[k]].map(|t| thumbnails.full(t));
                found[row * columns + k].extend(Observation::new(frame, pixel, grey, 1.0));
            }
        }
    }
    let points = tile.walls(grid).zip(found);
    let points = points.filter(|(_, seen)| seen.len() > 1);
    points
        .map(|(wall, seen)| {
            let frame = surface.frame(wall);
            ObservedPoint {
                x_w: frame.x_w,
                normal: frame.normal(),
                seen,
            }
        })
        .collect()
}
