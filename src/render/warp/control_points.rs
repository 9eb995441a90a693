//! The points of a tile through which a local polynomial warp is fitted.

use super::patches::PATCH;
use super::projection::Points;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::tiles::Tile;
use crate::surface::Surface;
use nalgebra::Vector3;
use std::f64::consts::SQRT_2;

/// Points of a patch along each side, the last of which are the next one's first; those at 0 are
/// checked, the others fitted.
pub const POINTS: [f64; 5] = [-1.0, 1.0 - SQRT_2, 0.0, SQRT_2 - 1.0, 1.0];
/// Points from patch to patch.
pub const STEP: usize = POINTS.len() - 1;

/// The points of a tile whose projections tell all others'.
#[derive(Debug, Default)]
pub struct Lattice {
    exact: Vec<Vector3<f64>>,
    points: Points,
    /// Patches across and down.
    pub patches: [usize; 2],
}

impl Lattice {
    /// Puts the points of another tile in their place.
    pub(crate) fn set(&mut self, surface: &dyn Surface, canvas: &Canvas, tile: &Tile) {
        let along = |first: u32, count: u32| {
            let patches = (count as usize).div_ceil(PATCH);
            let at = move |k: usize| {
                let half = 0.5 * PATCH as f64;
                let (patch, point) = (k / STEP, k % STEP);
                f64::from(first) + (2 * patch) as f64 * half + half * (1.0 + POINTS[point])
            };
            (patches, (0..=patches * STEP).map(at).collect::<Vec<f64>>())
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

    /// The points; the first is the tile's first pixel.
    pub fn points(&self) -> &Points {
        &self.points
    }

    pub fn columns(&self) -> usize {
        self.patches[0] * STEP + 1
    }
}
