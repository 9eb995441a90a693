//! A regular grid on the unrolled wall, on which frames are compared.

use crate::model::context::EstimationContext;
use nalgebra::Vector3;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Footprint, WallPoint, mean_radius_m, viewing_distance};
use tunnelstitch_geometry::trajectory::Pose;

/// Largest number of grid points, which bounds the memory: a frame that looks far along the tunnel
/// sees more wall, but not in detail.
const MAX_POINTS: usize = 1 << 20;

/// A regular grid on the unrolled wall, about one point a pixel of a pyramid level.
#[derive(Clone, Copy, Debug)]
pub struct MosaicGrid {
    /// Arc length of the first column, metres.
    pub s_m: f64,
    /// Chainage of the first row, metres.
    pub h_m: f64,
    /// Distance between columns and between rows, metres.
    pub spacing_m: f64,
    /// Columns.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
}

impl MosaicGrid {
    /// Covers `footprint` with points `spacing_m` apart, or farther if they would be too many.
    pub fn over(footprint: &Footprint, spacing_m: f64) -> Self {
        let (width, height) = (
            footprint.s_max_m - footprint.s_min_m,
            footprint.h_max_m - footprint.h_min_m,
        );
        let spacing_m = spacing_m.max((width * height / MAX_POINTS as f64).sqrt());
        let count = |length: f64| (length / spacing_m).floor() as usize + 1;
        Self {
            s_m: footprint.s_min_m,
            h_m: footprint.h_min_m,
            spacing_m,
            columns: count(width),
            rows: count(height),
        }
    }

    /// The wall point with number k, counted row by row.
    pub fn wall_point(&self, k: usize) -> WallPoint {
        let (column, row) = (k % self.columns, k / self.columns);
        WallPoint {
            s_m: self.s_m + column as f64 * self.spacing_m,
            h_m: self.h_m + row as f64 * self.spacing_m,
        }
    }

    /// The grid points in the world, metres, row by row.
    pub fn world_points(&self, context: &EstimationContext) -> Vec<Vector3<f64>> {
        let axis = |from: f64, n: usize| -> Vec<f64> {
            (0..n).map(|k| from + k as f64 * self.spacing_m).collect()
        };
        let mut points = Vec::new();
        let (s, h) = (axis(self.s_m, self.columns), axis(self.h_m, self.rows));
        context.surface.lattice(&s, &h, &mut points);
        points
    }

    /// The unit normals of the wall at the columns, at the chainage of the middle row.
    pub fn column_normals(&self, context: &EstimationContext) -> Vec<Vector3<f32>> {
        let h_m = self.h_m + 0.5 * self.rows as f64 * self.spacing_m;
        (0..self.columns)
            .map(|column| {
                let s_m = self.s_m + column as f64 * self.spacing_m;
                let frame = context.surface.frame(WallPoint { s_m, h_m });
                frame.e_s.cross(&frame.e_h).normalize().cast()
            })
            .collect()
    }
}

/// Width of a pixel on the wall where `pose` looks, metres.
pub fn pixel_size_m(context: &EstimationContext, camera: &Camera, pose: &Pose) -> f64 {
    let surface = context.surface.as_ref();
    let distance_m = viewing_distance(surface, camera, pose);
    distance_m.unwrap_or_else(|_| mean_radius_m(surface)) / camera.vertical_focal_px()
}
