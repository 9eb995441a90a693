//! Maps of resolution, uncertainty and properties of the wall over the panorama.

use super::raster_target::georeference;
use crate::layout::canvas::{Canvas, Layout};
use crate::layout::placement::{NO_FRAME, Placement};
use crate::layout::sightings::px_per_metre;
use crate::layout::tiles::{EDGE, tiles};
use nalgebra::{Matrix2, Matrix6};
use std::path::Path;
use tunnelstitch_core::persist::atomic::OutputSet;
use tunnelstitch_core::raster::{
    CogWriter, Compression, Quantity, RasterError, RasterSpec, RasterTile, Reduce, SampleType,
};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Surface, WallPoint, wall_jacobian};

/// Map of one number for each node of a grid; NaN where there is none.
#[derive(Clone, Debug)]
pub struct Map {
    grid: Canvas,
    values: Vec<f32>,
}

impl Map {
    /// Maps the resolution: millimetres of wall per pixel of the frame that is shown, along the
    /// direction in which they are most.
    ///
    /// `labels`: the frames of the grid's nodes; without them, the frame that is finest there.
    pub fn resolution(
        surface: &dyn Surface,
        cameras: &Cameras,
        placements: &[Placement],
        grid: &Canvas,
        labels: Option<&[u32]>,
    ) -> Self {
        Self::of(
            surface,
            cameras,
            placements,
            grid,
            labels,
            |_, px_per_metre| (1e3 / px_per_metre) as f32,
        )
    }

    /// Maps the uncertainty: 1-σ of the true position of the wall point that is shown, millimetres,
    /// along the direction in which it is largest: `√λ_max(A Σ Aᵀ)` with the covariance Σ of the
    /// frame's pose and `A = ∂(s, h)/∂ξ` ([`wall_jacobian`]).
    pub fn uncertainty(
        surface: &dyn Surface,
        cameras: &Cameras,
        placements: &[Placement],
        grid: &Canvas,
        labels: Option<&[u32]>,
        covariances: &[Matrix6<f64>],
    ) -> Self {
        let sigma_mm = |(frame, wall): (usize, _), _| {
            let a = wall_jacobian(&placements[frame].pose, &wall);
            let covariance: Matrix2<f64> = a * covariances[frame] * a.transpose();
            if !covariance.iter().all(|v| v.is_finite()) {
                return f32::NAN;
            }
            let largest = covariance.symmetric_eigenvalues().max();
            (1e3 * largest.max(0.0).sqrt()) as f32
        };
        Self::of(surface, cameras, placements, grid, labels, sigma_mm)
    }

    /// Maps a property of the wall by its value at a point.
    pub fn of_wall(grid: &Canvas, value: impl Fn(WallPoint) -> f32 + Sync) -> Self {
        let rows = (0..grid.rows as usize).par_map(|row| {
            let at = |column: u32| value(grid.wall(column, row as u32));
            (0..grid.columns).map(at).collect::<Vec<f32>>()
        });
        Self {
            grid: *grid,
            values: rows.concat(),
        }
    }

    fn of(
        surface: &dyn Surface,
        cameras: &Cameras,
        placements: &[Placement],
        grid: &Canvas,
        labels: Option<&[u32]>,
        value: impl Fn((usize, tunnelstitch_geometry::surface::WallFrame), f64) -> f32 + Sync,
    ) -> Self {
        let columns = grid.columns as usize;
        let mut values = vec![f32::NAN; grid.pixels()];
        for band in tiles(surface, grid, placements, EDGE) {
            let parts: Vec<Vec<f32>> = band.par_map(|tile| {
                let node = |k: usize| {
                    let (row, column) = (k / tile.columns as usize, k % tile.columns as usize);
                    (tile.row as usize + row) * columns + tile.column as usize + column
                };
                let of_point = |(k, point)| {
                    let wall = surface.frame(point);
                    let fine = |frame: usize| {
                        let placement = &placements[frame];
                        let camera = placement.camera(cameras.of(frame));
                        px_per_metre(&camera, &placement.pose, &wall)
                    };
                    let label = labels.map(|labels| labels[node(k)]);
                    let shown = match label {
                        Some(NO_FRAME) => None,
                        Some(frame) => Some(frame as usize),
                        None => finest(&tile.frames, &fine),
                    };
                    shown
                        .and_then(|frame| Some(value((frame, wall), fine(frame)?)))
                        .unwrap_or(f32::NAN)
                };
                tile.walls(grid).enumerate().map(of_point).collect()
            });
            for (tile, part) in band.iter().zip(parts) {
                let rows = part.chunks_exact(tile.columns as usize);
                for (row, part) in rows.enumerate() {
                    let start = (tile.row as usize + row) * columns + tile.column as usize;
                    values[start..start + part.len()].copy_from_slice(part);
                }
            }
        }
        Self {
            grid: *grid,
            values,
        }
    }

    /// Values, row-major as [`Layout::ThetaRight`].
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Adds the map of a quantity to a set of outputs, as Cloud-Optimised GeoTIFF of single
    /// precision.
    ///
    /// # Errors
    /// As [`CogWriter`].
    pub fn add_to(
        &self,
        outputs: &mut OutputSet,
        path: &Path,
        layout: Layout,
        quantity: Quantity,
    ) -> Result<(), RasterError> {
        let [width, height] = layout.size(&self.grid);
        let spec = RasterSpec {
            width,
            height,
            samples: SampleType::F32,
            channels: 1,
            alpha: false,
            nodata: None,
            reduce: Reduce::Mean,
            georeference: Some(georeference(&self.grid, layout)),
            quantity: Some(quantity),
        };
        let mut writer = CogWriter::begin(path, spec, Compression::Deflate)?;
        let edge = tunnelstitch_core::raster::TILE_EDGE_PX as u32;
        for row in 0..height.div_ceil(edge) {
            let tiles = (0..width.div_ceil(edge)).map(|column| {
                let pixels = (0..edge * edge).flat_map(|k| {
                    let (x, y) = (column * edge + k % edge, row * edge + k / edge);
                    let value = if x < width && y < height {
                        self.at(layout, [x, y])
                    } else {
                        0.0
                    };
                    value.to_ne_bytes()
                });
                RasterTile {
                    column,
                    row,
                    pixels: pixels.collect(),
                }
            });
            writer.add(tiles.collect())?;
        }
        writer.finish(outputs)
    }

    fn at(&self, layout: Layout, pixel: [u32; 2]) -> f32 {
        let [column, row] = layout.from_picture(&self.grid, pixel.map(f64::from));
        self.values[row as usize * self.grid.columns as usize + column as usize]
    }
}

/// Frame of the highest resolution; of equals the first.
fn finest(frames: &[usize], fine: &impl Fn(usize) -> Option<f64>) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for frame in frames {
        if let Some(px) = fine(*frame)
            && best.is_none_or(|(_, most)| px > most)
        {
            best = Some((*frame, px));
        }
    }
    best.map(|(frame, _)| frame)
}
