//! The points of a tile through which a local polynomial warp is fitted.

use super::patches::PATCH_EDGE;
use super::projection::LocalPoints;
use crate::layout::canvas::Canvas;
use crate::layout::tiles::Tile;
use nalgebra::Vector3;
use std::f64::consts::SQRT_2;
use tunnelstitch_geometry::surface::Surface;

/// Coordinates of a patch's control points along each axis; the last are the next patch's first.
/// The polynomial is checked at 0 and fitted at the others.
pub const PATCH_POINTS: [f64; 5] = [-1.0, 1.0 - SQRT_2, 0.0, SQRT_2 - 1.0, 1.0];
/// Control points from one patch to the next.
pub const POINTS_PER_PATCH: usize = PATCH_POINTS.len() - 1;

/// Control points of all patches of a tile.
#[derive(Debug, Default)]
pub struct ControlPoints {
    exact: Vec<Vector3<f64>>,
    points: LocalPoints,
    /// Number of patches across and down.
    pub patches: [usize; 2],
}

impl ControlPoints {
    /// Replaces the points by those of another tile.
    pub(crate) fn set(&mut self, surface: &dyn Surface, canvas: &Canvas, tile: &Tile) {
        let along = |first: u32, count: u32| {
            let patches = (count as usize).div_ceil(PATCH_EDGE);
            let at = move |k: usize| {
                let half = 0.5 * PATCH_EDGE as f64;
                let (patch, point) = (k / POINTS_PER_PATCH, k % POINTS_PER_PATCH);
                f64::from(first) + (2 * patch) as f64 * half + half * (1.0 + PATCH_POINTS[point])
            };
            (
                patches,
                (0..=patches * POINTS_PER_PATCH)
                    .map(at)
                    .collect::<Vec<f64>>(),
            )
        };
        let (across, columns) = along(tile.column, tile.columns);
        let (down, rows) = along(tile.row, tile.rows);
        let s_m = columns
            .iter()
            .map(|column| canvas.wall_at([*column, 0.0]).s_m);
        let h_m = rows.iter().map(|row| canvas.wall_at([0.0, *row]).h_m);
        let (s_m, h_m): (Vec<f64>, Vec<f64>) = (s_m.collect(), h_m.collect());
        surface.lattice(&s_m, &h_m, &mut self.exact);
        self.points.set(&self.exact);
        self.patches = [across, down];
    }

    /// The points, row-major; the first is the tile's first pixel.
    pub fn points(&self) -> &LocalPoints {
        &self.points
    }

    pub fn columns(&self) -> usize {
        self.patches[0] * POINTS_PER_PATCH + 1
    }
}
