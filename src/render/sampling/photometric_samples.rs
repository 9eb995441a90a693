//! What the frames show of single points of the wall.

use super::point_batch::PointBatch as Run;
use super::thumbnails::Thumbnails;
use crate::frames::{SHADING_TERMS, shading_terms};
use crate::render::layout::canvas::Canvas;
use crate::render::layout::placement::Placement;
use crate::render::layout::tiles::{EDGE, Tile, tiles};
use crate::render::warp::projection::LocalPoints as Points;
use crate::surface::Surface;
use nalgebra::Vector2;
use rayon::prelude::*;

/// What one frame shows of a wall point.
#[derive(Clone, Copy, Debug)]
pub struct Glimpse {
    /// The frame.
    pub frame: usize,
    /// The pixel, of the frame's own size.
    pub pixel: [f32; 2],
    /// The grey value, of 255.
    pub grey: f32,
}

impl Glimpse {
    /// The terms of the shading at its pixel of a frame of `size` pixels.
    pub fn terms(&self, size: (usize, usize)) -> [f64; SHADING_TERMS] {
        let [u, v] = self.pixel.map(f64::from);
        shading_terms(&Vector2::new(u, v), size)
    }
}

/// Darker and brighter than this (grey levels of 255) a frame tells little of a factor: it may be
/// clipped.
const USEFUL: std::ops::Range<f32> = 4.0..250.0;

/// Glimpses of the points of `grid` that at least two frames show, by the thumbnails.
pub fn glimpses(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    placements: &[Placement],
    grid: &Canvas,
) -> Vec<Vec<Glimpse>> {
    let bands = tiles(surface, grid, placements, EDGE);
    let found: Vec<Vec<Vec<Glimpse>>> = bands
        .par_iter()
        .flatten()
        .map(|tile| of_tile(surface, thumbnails, placements, grid, tile))
        .collect();
    found.into_iter().flatten().collect()
}

fn of_tile(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    placements: &[Placement],
    grid: &Canvas,
    tile: &Tile,
) -> Vec<Vec<Glimpse>> {
    let points = Points::new(&tile.points(surface, grid));
    let mut found: Vec<Vec<Glimpse>> = vec![Vec::new(); tile.pixels()];
    let columns = tile.columns as usize;
    let mut run = Run::default();
    for &frame in &tile.frames {
        let view = thumbnails.view(frame, &placements[frame], &points);
        for row in 0..tile.rows as usize {
            view.look_at(&mut run, row * columns, columns);
            let (u, v) = run.pixels();
            for k in 0..columns {
                if !run.seen()[k] {
                    continue;
                }
                let grey = thumbnails.format().grey(run.values()[k]);
                if USEFUL.contains(&grey) {
                    found[row * columns + k].push(Glimpse {
                        frame,
                        pixel: [u[k], v[k]].map(|t| thumbnails.full(t)),
                        grey,
                    });
                }
            }
        }
    }
    found.retain(|point| point.len() > 1);
    found
}
