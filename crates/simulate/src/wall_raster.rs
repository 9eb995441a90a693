//! Raster of a stretch of the lit wall.

use crate::options::Illumination;
use crate::texture::wall_texture::WallTexture;
use crate::wet_patches::{WaterFilm, WetPatches};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Maximum texels of a raster: four bytes each, and three more where the wall is wet.
pub(super) const MAX_TEXELS: usize = 1 << 26;
/// Number of points that are sampled at a time.
pub(super) const BATCH_POINTS: usize = 64;

/// Appearance of the wall.
#[derive(Clone, Copy)]
pub(super) struct WallPaint<'a> {
    /// Texture under even light.
    pub texture: &'a dyn WallTexture,
    /// Illumination.
    pub light: Illumination,
    /// Wet patches, if there are any.
    pub wet_patches: Option<&'a WetPatches>,
}

/// Texels of a raster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TexelGrid {
    /// Number of texels once around.
    pub columns: usize,
    /// Size of a texel, metres.
    pub texel_m: f64,
    /// Points of the texture along each side of a texel, which is their mean.
    pub points: usize,
}

/// Lit grey levels of the wall between two chainages, once around.
///
/// Texel `(k, n)` is centred at `s = (k + ½) texel`, `h = (n + ½) texel` for n from `first_row`, so
/// a texel of the wall has the same value in every raster that holds it.
pub(super) struct WallRaster {
    texel_m: f64,
    columns: usize,
    first_row: i64,
    rows: usize,
    /// Grey levels, row-major; each row ends with a copy of its first texel.
    texels: Vec<f32>,
    /// Water on the wall, in rows of `columns` texels; empty for a dry wall.
    water: Vec<WaterFilm>,
}

impl WallRaster {
    /// Paints the wall from chainage `h_m[0]` to `h_m[1]`, metres, in parallel.
    pub fn paint(paint: &WallPaint, grid: TexelGrid, h_m: [f64; 2]) -> Self {
        let TexelGrid {
            columns,
            texel_m,
            points,
        } = grid;
        // One more row on either side for the interpolation.
        let first_row = (h_m[0] / texel_m).floor() as i64 - 1;
        let rows = Self::row_count(h_m, texel_m);
        let mut texels = vec![0.0; rows * (columns + 1)];
        let shade: Vec<f32> = (0..columns)
            .map(|k| paint.light.shade(TAU * (k as f64 + 0.5) / columns as f64))
            .collect();
        texels
            .par_chunks_exact_mut(columns + 1)
            .enumerate()
            .for_each(|(k, row)| {
                let (once, again) = row.split_at_mut(columns);
                let h_m = |part: f64| ((first_row + k as i64) as f64 + part) * texel_m;
                if points == 1 {
                    paint.texture.fill_row(h_m(0.5), texel_m, once);
                } else {
                    let mut finer = vec![0.0; points * columns];
                    for j in 0..points {
                        let h_m = h_m((j as f64 + 0.5) / points as f64);
                        finer.fill(0.0);
                        let texel_m = texel_m / points as f64;
                        paint.texture.fill_row(h_m, texel_m, &mut finer);
                        for (texel, parts) in once.iter_mut().zip(finer.chunks_exact(points)) {
                            *texel += parts.iter().sum::<f32>() / (points * points) as f32;
                        }
                    }
                }
                for (texel, shade) in once.iter_mut().zip(&shade) {
                    *texel *= shade;
                }
                again[0] = once[0];
            });
        let mut raster = Self {
            texel_m,
            columns,
            first_row,
            rows,
            texels,
            water: Vec::new(),
        };
        if let Some(wet_patches) = paint.wet_patches {
            raster.add_wet_patches(wet_patches);
        }
        raster
    }

    /// Adds wet patches, which are darker and reflect specularly.
    fn add_wet_patches(&mut self, wet_patches: &WetPatches) {
        let (columns, texel_m, first_row) = (self.columns, self.texel_m, self.first_row);
        self.water = vec![WaterFilm::default(); self.rows * columns];
        self.texels
            .par_chunks_exact_mut(columns + 1)
            .zip(self.water.par_chunks_exact_mut(columns))
            .enumerate()
            .for_each(|(k, (row, water))| {
                let h_m = ((first_row + k as i64) as f64 + 0.5) * texel_m;
                wet_patches.fill_row(h_m, texel_m, water);
                for (texel, water) in row.iter_mut().zip(water.iter()) {
                    *texel *= water.albedo();
                }
                row[columns] = row[0];
            });
    }

    /// Adds the specular reflections of the camera's lamp to grey levels.
    ///
    /// The rays of directions `d` meet the wall at angles θ (in `[0, 2π)`) and chainages h (metres,
    /// within the raster), at most [`BATCH_POINTS`] of them. The nearest texel is used, since
    /// texels are finer than pixels.
    #[inline(always)]
    pub fn add_glints(
        &self,
        theta: &[f64],
        h_m: &[f64],
        d: impl Fn(usize) -> Vector3<f64>,
        values: &mut [f32],
    ) {
        if self.water.is_empty() {
            return;
        }
        let scale = self.columns as f64 / TAU;
        let (last, last_row) = (self.columns as i32 - 1, self.rows as i32 - 1);
        let (first_row, texel_m) = (self.first_row as f64, self.texel_m);
        let mut at = [[0i32; 2]; BATCH_POINTS];
        for (at, (theta, h_m)) in at.iter_mut().zip(theta.iter().zip(h_m)) {
            let row = ((h_m / texel_m).floor() - first_row) as i32;
            *at = [((theta * scale) as i32).min(last), row.clamp(0, last_row)];
        }
        for (k, (theta, [column, row])) in theta.iter().zip(at).enumerate() {
            let water = self.water[row as usize * self.columns + column as usize];
            if water.wet > 0 && !theta.is_nan() {
                values[k] += water.glint(*theta, &d(k));
            }
        }
    }

    /// Number of rows of a raster between two chainages, metres.
    pub fn row_count(h_m: [f64; 2], texel_m: f64) -> usize {
        ((h_m[1] / texel_m).floor() - (h_m[0] / texel_m).floor()) as usize + 3
    }

    /// Samples the grey levels bilinearly.
    ///
    /// Angles θ in `[0, 2π)` and chainages h (metres) within the raster, at most
    /// [`BATCH_POINTS`]; NaN gives 0.
    #[inline(always)]
    pub fn sample(&self, theta: &[f64], h_m: &[f64], values: &mut [f32]) {
        let columns = self.columns as f64;
        let (last, last_row) = (self.columns as i32 - 1, self.rows as i32 - 2);
        let (first_row, texel_m) = (self.first_row as f64, self.texel_m);
        let mut at = [[0i32; BATCH_POINTS]; 2];
        let mut share = [[0.0f32; BATCH_POINTS]; 2];
        let mut corners = [[0.0f32; BATCH_POINTS]; 4];
        let [column, row] = &mut at;
        let [fx, fy] = &mut share;
        for (k, (theta, h_m)) in theta.iter().zip(h_m).enumerate().take(BATCH_POINTS) {
            let x = theta * (columns / TAU) - 0.5;
            let x = if x < 0.0 { x + columns } else { x };
            let y = h_m / texel_m - 0.5 - first_row;
            column[k] = (x as i32).min(last);
            row[k] = (y as i32).clamp(0, last_row);
            fx[k] = (x - f64::from(column[k])) as f32;
            fy[k] = (y - f64::from(row[k])) as f32;
        }
        for (k, (column, row)) in column.iter().zip(row).enumerate().take(theta.len()) {
            let start = *row as usize * (self.columns + 1) + *column as usize;
            let below = start + self.columns + 1;
            let (upper, lower) = (
                &self.texels[start..start + 2],
                &self.texels[below..below + 2],
            );
            (corners[0][k], corners[1][k]) = (upper[0], upper[1]);
            (corners[2][k], corners[3][k]) = (lower[0], lower[1]);
        }
        let [a, b, c, d] = &corners;
        for (k, value) in values.iter_mut().enumerate().take(BATCH_POINTS) {
            let upper = a[k] + (b[k] - a[k]) * fx[k];
            let lower = c[k] + (d[k] - c[k]) * fx[k];
            let own = upper + (lower - upper) * fy[k];
            *value = if own.is_nan() { 0.0 } else { own };
        }
    }
}

impl Illumination {
    /// Share of the light on the wall at angle θ (radians).
    pub(super) fn shade(self, theta: f64) -> f32 {
        match self {
            Self::Even => 1.0,
            Self::Downward => (0.35 + 0.65 * 0.5 * (1.0 + theta.cos())) as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey level that varies smoothly with angle and chainage.
    struct Ramp;

    impl WallTexture for Ramp {
        fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
            let count = row.len() as f64;
            for (k, value) in row.iter_mut().enumerate() {
                let theta = TAU * (k as f64 + 0.5) / count;
                *value = (100.0 + 40.0 * theta.cos() + 7.0 * h_m) as f32;
            }
            assert!(texel_m > 0.0);
        }
    }

    fn ramp() -> WallPaint<'static> {
        WallPaint {
            texture: &Ramp,
            light: Illumination::Even,
            wet_patches: None,
        }
    }

    fn grid(columns: usize, texel_m: f64, points: usize) -> TexelGrid {
        TexelGrid {
            columns,
            texel_m,
            points,
        }
    }

    /// A coarse texel is the mean of the fine ones in it.
    #[test]
    fn coarse_texels_are_means() {
        let texel_m = TAU * 3.0 / 720.0;
        let fine = WallRaster::paint(&ramp(), grid(720, texel_m, 1), [0.0, 2.0]);
        let coarse = WallRaster::paint(&ramp(), grid(180, 4.0 * texel_m, 4), [0.0, 2.0]);
        let texel = |raster: &WallRaster, k: usize, n: i64| {
            raster.texels[(n - raster.first_row) as usize * (raster.columns + 1) + k]
        };
        for k in [0, 50, 179] {
            for n in 0..10 {
                let own = (0..16).map(|j| texel(&fine, 4 * k + j % 4, 4 * n + j as i64 / 4));
                let mean = own.sum::<f32>() / 16.0;
                assert!((texel(&coarse, k, n) - mean).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn a_raster_shows_the_wall_across_the_wrap_and_up_to_its_ends() {
        let (columns, radius_m) = (720, 3.0);
        let texel_m = TAU * radius_m / columns as f64;
        let raster = WallRaster::paint(&ramp(), grid(columns, texel_m, 1), [-1.0, 2.0]);
        for theta in [0.0, 0.001, 1.0, 3.1, TAU - 0.001] {
            for h_m in [-1.0, 0.0, 0.777, 2.0] {
                let expected = 100.0 + 40.0 * theta.cos() + 7.0 * h_m;
                let mut seen = [0.0; 2];
                raster.sample(&[theta, f64::NAN], &[h_m, f64::NAN], &mut seen);
                assert!((f64::from(seen[0]) - expected).abs() < 1e-3);
                assert_eq!(seen[1], 0.0);
            }
        }
    }

    #[test]
    fn the_dark_side_has_a_third_of_the_light() {
        assert!((Illumination::Downward.shade(0.0) - 1.0).abs() < 1e-6);
        assert!((Illumination::Downward.shade(TAU / 2.0) - 0.35).abs() < 1e-6);
        assert_eq!(Illumination::Even.shade(2.0), 1.0);
    }
}
