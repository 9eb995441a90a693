//! A stretch of the lit wall as a raster.

use super::Light;
use super::damp::{Damp, Water};
use super::wall::Texture;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Rows of texels between two chainages, once around: lit grey levels.
///
/// Texel `(k, n)` is centred at `s = (k + ½) texel`, `h = (n + ½) texel` for n from `first_row`, so texels of
/// the same wall are the same in whatever band they lie.
pub(super) struct Band {
    texel_m: f64,
    columns: usize,
    first_row: i64,
    rows: usize,
    /// Row-major; each row ends with a copy of its first texel.
    texels: Vec<f32>,
    /// Damp, where the wall has any: rows of `columns` texels.
    water: Vec<Water>,
}

impl Band {
    /// Paints the wall from chainage `h_m[0]` to `h_m[1]`, metres, in parallel.
    pub fn paint(
        texture: &dyn Texture,
        light: Light,
        damp: Option<&Damp>,
        columns: usize,
        texel_m: f64,
        h_m: [f64; 2],
    ) -> Self {
        // One row more on either side for the interpolation.
        let first_row = (h_m[0] / texel_m).floor() as i64 - 1;
        let rows = Self::rows(h_m, texel_m);
        let mut texels = vec![0.0; rows * (columns + 1)];
        let shade: Vec<f32> = (0..columns)
            .map(|k| light.shade(TAU * (k as f64 + 0.5) / columns as f64))
            .collect();
        texels
            .par_chunks_exact_mut(columns + 1)
            .enumerate()
            .for_each(|(k, row)| {
                let h_m = ((first_row + k as i64) as f64 + 0.5) * texel_m;
                let (once, again) = row.split_at_mut(columns);
                texture.row(h_m, texel_m, once);
                for (texel, shade) in once.iter_mut().zip(&shade) {
                    *texel *= shade;
                }
                again[0] = once[0];
            });
        let mut band = Self {
            texel_m,
            columns,
            first_row,
            rows,
            texels,
            water: Vec::new(),
        };
        if let Some(damp) = damp {
            band.moisten(damp);
        }
        band
    }

    /// Puts damp on the wall: it is darker there, and glints.
    fn moisten(&mut self, damp: &Damp) {
        let (columns, texel_m, first_row) = (self.columns, self.texel_m, self.first_row);
        self.water = vec![Water::default(); self.rows * columns];
        self.texels
            .par_chunks_exact_mut(columns + 1)
            .zip(self.water.par_chunks_exact_mut(columns))
            .enumerate()
            .for_each(|(k, (row, water))| {
                let h_m = ((first_row + k as i64) as f64 + 0.5) * texel_m;
                damp.row(h_m, texel_m, water);
                for (texel, water) in row.iter_mut().zip(water.iter()) {
                    *texel *= water.albedo();
                }
                row[columns] = row[0];
            });
    }

    /// Brightness that the camera's lamp adds where a ray of direction `d` meets the wall at angle θ (in `[0, 2π)`) and
    /// chainage h (metres, within the band), grey levels. Of the nearest texel: texels are finer than pixels.
    #[inline]
    pub fn glint(&self, theta: f64, h_m: f64, d: &Vector3<f64>) -> f32 {
        if self.water.is_empty() {
            return 0.0;
        }
        let column = (theta * (self.columns as f64 / TAU)) as usize;
        let row = ((h_m / self.texel_m).floor() as i64 - self.first_row) as usize;
        let k = row.min(self.rows - 1) * self.columns + column.min(self.columns - 1);
        self.water[k].glint(theta, d)
    }

    /// Rows that a band between two chainages has.
    pub fn rows(h_m: [f64; 2], texel_m: f64) -> usize {
        ((h_m[1] / texel_m).floor() - (h_m[0] / texel_m).floor()) as usize + 3
    }

    /// The grey level at angle θ (any turn) and chainage h (metres, within the band), bilinear.
    #[inline]
    pub fn at(&self, theta: f64, h_m: f64) -> f32 {
        let x = theta * (self.columns as f64 / TAU) - 0.5;
        let x = if x < 0.0 { x + self.columns as f64 } else { x };
        let y = h_m / self.texel_m - 0.5 - self.first_row as f64;
        let (column, row) = (
            (x as usize).min(self.columns - 1),
            (y as usize).min(self.rows - 2),
        );
        let (fx, fy) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let start = row * (self.columns + 1) + column;
        let below = start + self.columns + 1;
        let (a, b) = (self.texels[start], self.texels[start + 1]);
        let (c, d) = (self.texels[below], self.texels[below + 1]);
        let (upper, lower) = (a + (b - a) * fx, c + (d - c) * fx);
        upper + (lower - upper) * fy
    }
}

impl Light {
    /// Share of the light that falls on the wall at angle θ (radians).
    fn shade(self, theta: f64) -> f32 {
        match self {
            Self::Even => 1.0,
            Self::Downward => (0.35 + 0.65 * 0.5 * (1.0 + theta.cos())) as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey level by angle and chainage.
    struct Ramp;

    impl Texture for Ramp {
        fn row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
            let count = row.len() as f64;
            for (k, value) in row.iter_mut().enumerate() {
                let theta = TAU * (k as f64 + 0.5) / count;
                *value = (100.0 + 40.0 * theta.cos() + 7.0 * h_m) as f32;
            }
            assert!(texel_m > 0.0);
        }
    }

    #[test]
    fn a_band_shows_the_wall_across_the_wrap_and_up_to_its_ends() {
        let (columns, radius_m) = (720, 3.0);
        let texel_m = TAU * radius_m / columns as f64;
        let band = Band::paint(&Ramp, Light::Even, None, columns, texel_m, [-1.0, 2.0]);
        for theta in [0.0, 0.001, 1.0, 3.1, TAU - 0.001] {
            for h_m in [-1.0, 0.0, 0.777, 2.0] {
                let expected = 100.0 + 40.0 * theta.cos() + 7.0 * h_m;
                assert!((f64::from(band.at(theta, h_m)) - expected).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn the_dark_side_has_a_third_of_the_light() {
        assert!((Light::Downward.shade(0.0) - 1.0).abs() < 1e-6);
        assert!((Light::Downward.shade(TAU / 2.0) - 0.35).abs() < 1e-6);
        assert_eq!(Light::Even.shade(2.0), 1.0);
    }
}
