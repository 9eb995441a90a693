//! Shading of all frames by a light that moves with the camera, and by vignetting.

use super::grey::GreyImage;
use nalgebra::{DMatrix, DVector, Vector2};
use serde::{Deserialize, Serialize};

/// Highest total degree of the polynomial.
const DEGREE: usize = 6;
/// Its terms: all `x^i y^j` with `1 ≤ i + j ≤ 6`. A constant would be every frame's gain.
pub const TERMS: usize = (DEGREE + 1) * (DEGREE + 2) / 2 - 1;

/// Smooth shading fixed to the camera, `V(u, v) = exp(Σ c_k B_k(u, v))`, where a frame shows
/// `I = a V S + b`.
///
/// `B_k` are products of Legendre polynomials in the pixel coordinates scaled to ±1, so that the
/// terms hardly depend on one another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shading {
    size: (usize, usize),
    coefficients: [f64; TERMS],
}

/// The terms `B_k` at a pixel of a picture of `size` pixels.
pub fn terms(pixel: &Vector2<f64>, size: (usize, usize)) -> [f64; TERMS] {
    let scaled = |x: f64, n: usize| 2.0 * x / (n.max(2) - 1) as f64 - 1.0;
    let (p, q) = (
        legendre(scaled(pixel.x, size.0)),
        legendre(scaled(pixel.y, size.1)),
    );
    let mut terms = [0.0; TERMS];
    let mut k = 0;
    for degree in 1..=DEGREE {
        for j in 0..=degree {
            terms[k] = p[degree - j] * q[j];
            k += 1;
        }
    }
    terms
}

/// `P_0 … P_6`: `(n+1) P_{n+1} = (2n+1) x P_n − n P_{n−1}`.
fn legendre(x: f64) -> [f64; DEGREE + 1] {
    let mut p = [1.0; DEGREE + 1];
    p[1] = x;
    for n in 1..DEGREE {
        let m = n as f64;
        p[n + 1] = ((2.0 * m + 1.0) * x * p[n] - m * p[n - 1]) / (m + 1.0);
    }
    p
}

impl Shading {
    /// No shading: 1 everywhere on pictures of `size` pixels.
    pub fn none(size: (usize, usize)) -> Self {
        Self {
            size,
            coefficients: [0.0; TERMS],
        }
    }

    /// The shading times `exp(Σ δ_k B_k)`.
    pub fn changed(&self, delta: &[f64; TERMS]) -> Self {
        Self {
            size: self.size,
            coefficients: std::array::from_fn(|k| self.coefficients[k] + delta[k]),
        }
    }

    /// Width and height of the pictures, pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// The coefficients `c_k`.
    pub fn coefficients(&self) -> &[f64; TERMS] {
        &self.coefficients
    }

    /// `V` at a pixel.
    pub fn at(&self, pixel: &Vector2<f64>) -> f64 {
        self.log_at(pixel).exp()
    }

    /// `ln V` at a pixel.
    pub fn log_at(&self, pixel: &Vector2<f64>) -> f64 {
        let terms = terms(pixel, self.size);
        let products = terms.iter().zip(&self.coefficients);
        products.map(|(term, c)| term * c).sum()
    }

    /// The full-size pixel at a pixel of a pyramid level, whose `camera` is given:
    /// `u = 2^l u_l + (2^l − 1)/2`.
    pub fn full_size(
        &self,
        pixel: &Vector2<f64>,
        camera: &tunnelstitch_geometry::camera::Camera,
    ) -> Vector2<f64> {
        let scale = (self.size.0 as f64 / f64::from(camera.width))
            .log2()
            .round()
            .exp2();
        pixel * scale + Vector2::repeat(0.5 * (scale - 1.0))
    }

    /// The smallest and the largest V over the picture.
    pub fn range(&self) -> [f64; 2] {
        let (w, h) = self.size;
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for j in 0..=24 {
            for i in 0..=32 {
                let x = (w - 1) as f64 * f64::from(i) / 32.0;
                let y = (h - 1) as f64 * f64::from(j) / 24.0;
                let v = self.at(&Vector2::new(x, y));
                range = [range[0].min(v), range[1].max(v)];
            }
        }
        range
    }

    /// Divides a full-size picture by V.
    pub fn divide(&self, image: &mut GreyImage) {
        let (width, height) = self.size;
        // Along a row the logarithm is a polynomial in x: Σ_i (Σ_j c_ij P_j(y)) P_i(x).
        let across: Vec<[f32; DEGREE + 1]> = (0..width)
            .map(|x| legendre(2.0 * x as f64 / (width.max(2) - 1) as f64 - 1.0).map(|p| p as f32))
            .collect();
        let rows = image.data_mut().chunks_exact_mut(width);
        for (y, row) in rows.enumerate() {
            let q = legendre(2.0 * y as f64 / (height.max(2) - 1) as f64 - 1.0);
            let mut factors = [0.0f64; DEGREE + 1];
            let mut k = 0;
            for degree in 1..=DEGREE {
                for j in 0..=degree {
                    factors[degree - j] += self.coefficients[k] * q[j];
                    k += 1;
                }
            }
            let factors = factors.map(|f| f as f32);
            for (value, p) in row.iter_mut().zip(&across) {
                let log: f32 = factors.iter().zip(p).map(|(f, p)| f * p).sum();
                *value *= (-log).exp();
            }
        }
    }
}

/// The shading that fits the mean of many frames best, `log mean(u, v) = c + Σ c_k B_k`.
///
/// Over a survey every pixel sees all kinds of wall, so that what is left in the mean is the
/// camera's own; the wall's texture does not average out completely.
#[derive(Clone, Debug)]
pub struct MeanShading {
    /// The shading.
    pub shading: Shading,
    /// Number of pixels of the mean with a value.
    pub pixels: usize,
    /// Variance of `log mean` over them.
    pub variance: f64,
    /// The part of it that the shading does not explain.
    pub left: f64,
}

impl MeanShading {
    /// Fits a shading of pictures of `size` to their `mean`: a picture of any smaller size that
    /// shows the whole frame (cell centres at `(i + ½)/n` of its width), NaN where nothing is
    /// known. [`None`] if too little is.
    pub fn fit(mean: &GreyImage, size: (usize, usize)) -> Option<Self> {
        let (w, h) = (mean.width(), mean.height());
        let mut rows = Vec::new();
        for j in 0..h {
            for i in 0..w {
                let value = f64::from(mean.at(i, j));
                if value > 1.0 {
                    let x = (i as f64 + 0.5) / w as f64 * size.0 as f64 - 0.5;
                    let y = (j as f64 + 0.5) / h as f64 * size.1 as f64 - 0.5;
                    rows.push((terms(&Vector2::new(x, y), size), value.ln()));
                }
            }
        }
        if rows.len() < 4 * TERMS {
            return None;
        }
        let count = rows.len() as f64;
        let middle = rows.iter().map(|(_, log)| log).sum::<f64>() / count;
        let design = DMatrix::from_fn(rows.len(), TERMS + 1, |r, c| match c {
            0 => 1.0,
            c => rows[r].0[c - 1],
        });
        let target = DVector::from_iterator(rows.len(), rows.iter().map(|(_, log)| log - middle));
        let solution = (design.transpose() * &design)
            .cholesky()?
            .solve(&(design.transpose() * &target));
        Some(Self {
            shading: Shading {
                size,
                coefficients: std::array::from_fn(|k| solution[k + 1]),
            },
            pixels: rows.len(),
            variance: target.norm_squared() / count,
            left: (&target - &design * &solution).norm_squared() / count,
        })
    }

    /// True if the mean varies and the shading explains most of that: it is no mere texture.
    pub fn is_light(&self) -> bool {
        let explained = 1.0 - self.left / self.variance.max(f64::MIN_POSITIVE);
        self.variance.sqrt() > MIN_LOG_SPREAD && explained > MIN_EXPLAINED_SHARE
    }
}

/// Standard deviation of `log mean` over the picture below which nothing is corrected.
const MIN_LOG_SPREAD: f64 = 0.04;
/// Share of its variance that a shading must explain.
const MIN_EXPLAINED_SHARE: f64 = 0.8;

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp(x: f64, y: f64) -> f64 {
        let (dx, dy) = (x / 63.0 - 0.6, (y / 63.0) - 0.3);
        1.0 - 0.9 * (dx * dx + dy * dy)
    }

    #[test]
    fn a_lamp_is_found_in_the_mean_and_divided_out() {
        let size = (64, 48);
        let picture = |k: usize| {
            let (x, y) = ((k % 64) as f64, (k / 64) as f64);
            (120.0 * lamp(x, y)) as f32
        };
        let mut image = GreyImage::new(64, 48, (0..64 * 48).map(picture).collect());
        let found = MeanShading::fit(&image, size).unwrap();
        assert!(found.is_light());
        let shading = found.shading;
        let before = (shading.at(&Vector2::new(10.0, 40.0))
            / shading.at(&Vector2::new(38.0, 20.0)))
            / (lamp(10.0, 40.0) / lamp(38.0, 20.0));
        assert!((before - 1.0).abs() < 0.01, "{before}");
        shading.divide(&mut image);
        let (low, high) = image
            .data()
            .iter()
            .fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(high / low < 1.02, "{low} {high}");
    }

    #[test]
    fn an_even_mean_and_mere_texture_are_no_shading() {
        let size = (64, 48);
        let even = GreyImage::new(64, 48, vec![100.0; 64 * 48]);
        assert!(!MeanShading::fit(&even, size).unwrap().is_light());
        let texture = (0..64 * 48).map(|k: i32| 100.0 + 30.0 * (k as f32 * 12.9898).sin());
        let texture = GreyImage::new(64, 48, texture.collect());
        assert!(!MeanShading::fit(&texture, size).unwrap().is_light());
    }

    #[test]
    fn division_agrees_with_the_value_at_a_pixel() {
        let mut delta = [0.0; TERMS];
        delta
            .iter_mut()
            .enumerate()
            .for_each(|(k, d)| *d = 0.03 * ((k * 7) as f64).sin());
        let shading = Shading::none((40, 30)).changed(&delta);
        let mut image = GreyImage::new(40, 30, vec![1.0; 1200]);
        shading.divide(&mut image);
        for (x, y) in [(0, 0), (39, 29), (17, 5)] {
            let v = shading.at(&Vector2::new(x as f64, y as f64));
            assert!((f64::from(image.at(x, y)) * v - 1.0).abs() < 1e-5);
        }
    }
}
