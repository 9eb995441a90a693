//! Rendering of the unrolled wall.

use crate::scene::Scene;
use crate::wall_raster::BATCH_POINTS;
use crate::wall_stretches::WallStretch;
use rayon::prelude::*;
use std::f64::consts::TAU;
use tunnelstitch_core::frames::GreyImage;

/// Number of rows of [`Scene::wall`] that are rendered at a time.
const STRIP_ROWS: usize = 128;

impl Scene {
    /// Renders the unrolled wall under its illumination, without specular reflections,
    /// cables and lamps.
    ///
    /// The result has `rows` rows of `columns` square pixels, once around from θ = 0; the first row
    /// begins at chainage `h_start_m` (metres). Each pixel is the mean of points spread over its
    /// square, as many as over a frame's pixel, of the raster that frames are cast from.
    pub fn wall(&self, columns: usize, rows: usize, h_start_m: f64) -> GreyImage {
        let n = self.options.supersample as usize;
        let pixel_m = self.tunnel.perimeter_m() / columns as f64;
        let share = |k: usize| (k as f64 + 0.5) / n as f64;
        let mut data = vec![0.0; columns * rows];
        for (strip, pixels) in data.chunks_mut(columns * STRIP_ROWS).enumerate() {
            let from_m = h_start_m + (strip * STRIP_ROWS) as f64 * pixel_m;
            let h_m = [from_m, from_m + STRIP_ROWS as f64 * pixel_m];
            let raster = self.paint(&WallStretch::near(h_m));
            let lines = pixels.par_chunks_mut(columns).enumerate();
            lines.for_each(|(row, line)| {
                for (down, across) in (0..n * n).map(|k| (k / n, k % n)) {
                    let h_m = [from_m + (row as f64 + share(down)) * pixel_m; BATCH_POINTS];
                    for (part, pixels) in line.chunks_mut(BATCH_POINTS).enumerate() {
                        let column = |k: usize| (part * BATCH_POINTS + k) as f64 + share(across);
                        let theta: [f64; BATCH_POINTS] =
                            std::array::from_fn(|k| column(k) * TAU / columns as f64);
                        let (mut values, count) = ([0.0; BATCH_POINTS], pixels.len());
                        raster.sample(&theta[..count], &h_m[..count], &mut values);
                        for (pixel, value) in pixels.iter_mut().zip(&values) {
                            *pixel += value;
                        }
                    }
                }
                line.iter_mut().for_each(|pixel| *pixel /= (n * n) as f32);
            });
        }
        GreyImage::new(columns, rows, data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{SimulateOptions, Wall};
    use tunnelstitch_geometry::camera::Camera;

    /// At the centre of a frame on the axis, pixels are squares of the wall.
    #[test]
    fn the_wall_agrees_with_the_frames() {
        let options = SimulateOptions {
            wall: Wall::Concrete,
            camera: Camera::from_vertical_fov(161, 121, 60f64.to_radians()),
            ..SimulateOptions::centred()
        };
        let scene = Scene::new(&options).unwrap();
        let frame = scene.render_exact(0);
        let columns = (TAU * scene.camera().fy).round() as usize;
        let pixel_m = TAU * options.tunnel.nominal_m() / columns as f64;
        // The first pixel's middle lies half a pixel off θ = 0.
        let wall = scene.wall(columns, 4, -2.0 * pixel_m);
        for (u, v) in [(0, 1), (2, 2), (3, 0)] {
            let seen: f32 = (0..2)
                .flat_map(|k| (0..2).map(move |l| (k, l)))
                .map(|(k, l)| 0.25 * frame.at(80 + u + k, 58 + v + l))
                .sum();
            assert!(
                (wall.at(u, v) - seen).abs() < 1.0,
                "{} {seen}",
                wall.at(u, v)
            );
        }
    }
}
