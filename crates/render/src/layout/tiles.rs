//! Squares of the canvas, each with the frames that may see it.

use super::canvas::Canvas;
use super::placement::Placement;
use nalgebra::Vector3;
use tunnelstitch_geometry::surface::{Footprint, Surface, WallPoint};

/// Edge of a tile, pixels: its wall points stay in the second-level cache, and all that is known of
/// one of its rows in the first-level cache.
pub const EDGE: u32 = 128;

/// Most columns of a tile.
pub const TILE_COLUMNS: usize = EDGE as usize;

/// Rows of a band: those of a raster file's tiles.
pub const BAND_ROWS: u32 = tunnelstitch_core::raster::TILE_EDGE_PX as u32;

/// A rectangle of the canvas.
pub struct Tile {
    /// First column.
    pub column: u32,
    /// First row.
    pub row: u32,
    /// Number of columns.
    pub columns: u32,
    /// Number of rows.
    pub rows: u32,
    /// Frames whose footprints meet it, in their order.
    pub frames: Vec<usize>,
}

impl Tile {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// The pixels' centres on the unrolled wall, row-major.
    pub fn walls(&self, canvas: &Canvas) -> impl Iterator<Item = WallPoint> {
        let (canvas, columns) = (*canvas, self.column..self.column + self.columns);
        (self.row..self.row + self.rows)
            .flat_map(move |row| columns.clone().map(move |column| canvas.wall(column, row)))
    }

    /// The wall points of the pixels' centres, row-major, metres.
    pub fn points(&self, surface: &dyn Surface, canvas: &Canvas) -> Vec<Vector3<f64>> {
        let mut points = Vec::new();
        self.points_into(surface, canvas, &mut points);
        points
    }

    /// Writes the pixels' wall points into `points`, row-major, metres.
    pub fn points_into(
        &self,
        surface: &dyn Surface,
        canvas: &Canvas,
        points: &mut Vec<Vector3<f64>>,
    ) {
        let columns = self.column..self.column + self.columns;
        let s_m: Vec<f64> = columns.map(|column| canvas.wall(column, 0).s_m).collect();
        let rows = self.row..self.row + self.rows;
        let h_m: Vec<f64> = rows.map(|row| canvas.wall(0, row).h_m).collect();
        surface.lattice(&s_m, &h_m, points);
    }
}

/// Cuts a canvas into tiles, `edge` pixels (at most [`EDGE`]) wide and high, in bands from the
/// first row to the last, each band from the first column to the last.
pub fn tiles(
    surface: &dyn Surface,
    canvas: &Canvas,
    placements: &[Placement],
    edge: u32,
) -> Vec<Vec<Tile>> {
    (0..canvas.rows)
        .step_by(edge as usize)
        .map(|row| tiles_at(surface, canvas, placements, edge, row))
        .collect()
}

/// Cuts the band that begins at `row` into tiles.
pub fn tiles_at(
    surface: &dyn Surface,
    canvas: &Canvas,
    placements: &[Placement],
    edge: u32,
    row: u32,
) -> Vec<Tile> {
    let perimeter_m = surface.perimeter_m();
    let pixel_m = 1.0 / canvas.px_per_metre;
    let rows = edge.min(canvas.rows - row);
    let h_m = canvas.h_start_m + f64::from(row) * pixel_m;
    let frames_in = |s_m: f64, width_m: f64, among: &mut dyn Iterator<Item = usize>| {
        let tile = Footprint {
            s_min_m: s_m,
            s_max_m: s_m + width_m,
            h_min_m: h_m,
            h_max_m: h_m + f64::from(rows) * pixel_m,
        };
        among
            .filter(|frame| {
                let footprint = &placements[*frame].footprint;
                let around = footprint.widened_conservatively(pixel_m);
                around.overlaps(&tile, perimeter_m)
            })
            .collect::<Vec<usize>>()
    };
    let in_band = frames_in(0.0, perimeter_m, &mut (0..placements.len()));
    (0..canvas.columns)
        .step_by(edge as usize)
        .map(|column| {
            let columns = edge.min(canvas.columns - column);
            let s_m = f64::from(column) * pixel_m;
            let width_m = f64::from(columns) * pixel_m;
            Tile {
                column,
                row,
                columns,
                rows,
                frames: frames_in(s_m, width_m, &mut in_band.iter().copied()),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::placement::place_frames;
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::{Shutter, spiral};

    #[test]
    fn tiles_cover_the_canvas_once_and_know_their_frames() {
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(64, 48, 1.0);
        let poses = spiral(12, 0.5, 30f64.to_radians());
        let placements = place_frames(&circle, camera, &poses, &Shutter::default()).unwrap();
        let canvas = Canvas::of_placements(&circle, &placements, 40.0).unwrap();
        let bands = tiles(&circle, &canvas, &placements, EDGE);
        let pixels: u32 = bands
            .iter()
            .flatten()
            .map(|tile| tile.columns * tile.rows)
            .sum();
        assert_eq!(pixels as usize, canvas.pixels());
        for tile in bands.iter().flatten() {
            let points = tile.points(&circle, &canvas);
            for (frame, pose) in poses.iter().enumerate() {
                let seen = points.iter().any(|x_w| {
                    camera
                        .project(&pose.to_camera(x_w))
                        .is_some_and(|pixel| camera.is_in_image(&pixel, 0.0))
                });
                assert!(!seen || tile.frames.contains(&frame));
            }
        }
        // Most tiles are seen by a few frames only.
        let listed: usize = bands.iter().flatten().map(|tile| tile.frames.len()).sum();
        let all: usize = bands.iter().flatten().count() * poses.len();
        assert!(listed * 2 < all, "{listed} of {all}");
    }
}
