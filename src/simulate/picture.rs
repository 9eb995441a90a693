//! Walls papered with a picture.

use super::SimulateError;
use super::wall::Texture;
use crate::frames::GreyImage;
use std::path::Path;

/// A picture that repeats along s and h, upright and unmirrored as seen from inside: its x runs
/// along s, its y along h.
pub(super) struct PictureWall {
    picture: GreyImage,
    /// Metres of wall a pixel of the picture.
    pixel_m: f64,
}

/// Most samples along each side of a texel, when the picture is finer than the texels.
const MOST_SAMPLES: f64 = 16.0;

impl PictureWall {
    /// Reads the picture; `width_m` is fitted so that a whole number goes around.
    ///
    /// # Errors
    /// [`SimulateError::Texture`] for a file that cannot be read or decoded.
    pub fn open(path: &Path, width_m: f64, perimeter_m: f64) -> Result<Self, SimulateError> {
        let fail = |what: String| SimulateError::Texture {
            path: path.to_owned(),
            what,
        };
        let picture = image::ImageReader::open(path)
            .and_then(image::ImageReader::with_guessed_format)
            .map_err(|error| fail(error.to_string()))?
            .decode()
            .map_err(|error| fail(error.to_string()))?;
        let grey = picture.to_luma32f();
        let (width, height) = (grey.width() as usize, grey.height() as usize);
        if width < 2 || height < 2 {
            return Err(fail(format!("{width} × {height} px are no texture")));
        }
        let data = grey.into_raw().into_iter().map(|v| v * 255.0).collect();
        let around = (perimeter_m / width_m).round().max(1.0);
        Ok(Self {
            picture: GreyImage::new(width, height, data),
            pixel_m: perimeter_m / around / width as f64,
        })
    }

    /// Bilinear, repeating; `x` and `y` in pixels from the picture's corner.
    fn at(&self, x: f64, y: f64) -> f32 {
        let (width, height) = (self.picture.width(), self.picture.height());
        let cell = |x: f64, size: usize| {
            let x = (x - 0.5).rem_euclid(size as f64);
            let first = (x as usize).min(size - 1);
            (first, (first + 1) % size, (x - first as f64) as f32)
        };
        let (x0, x1, fx) = cell(x, width);
        let (y0, y1, fy) = cell(y, height);
        let across = |y: usize| {
            let (a, b) = (self.picture.at(x0, y), self.picture.at(x1, y));
            a + (b - a) * fx
        };
        let (a, b) = (across(y0), across(y1));
        a + (b - a) * fy
    }
}

impl Texture for PictureWall {
    fn row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
        let texel = texel_m / self.pixel_m;
        let n = texel.ceil().clamp(1.0, MOST_SAMPLES) as usize;
        let offset = |k: usize| texel * ((k as f64 + 0.5) / n as f64 - 0.5);
        let y = h_m / self.pixel_m;
        for (k, value) in row.iter_mut().enumerate() {
            let x = (k as f64 + 0.5) * texel;
            let mut sum = 0.0;
            for j in 0..n {
                for i in 0..n {
                    sum += self.at(x + offset(i), y + offset(j));
                }
            }
            *value = sum / (n * n) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_lies_upright_and_repeats() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("wall.png");
        // Brighter to the right by 2 and downwards by 3 a pixel.
        image::GrayImage::from_fn(20, 10, |x, y| image::Luma([(10 + 2 * x + 3 * y) as u8]))
            .save(&path)
            .unwrap();
        // 6.2 m around hold three pictures of 2 m: 10 cm a pixel become 10.33 cm.
        let wall = PictureWall::open(&path, 2.0, 6.2).unwrap();
        let pixel_m = 6.2 / 60.0;
        let mut row = vec![0.0; 60];
        for y in [0, 4, 9] {
            for turn in [-1.0, 0.0, 2.0] {
                let h_m = (f64::from(y) + 0.5 + 10.0 * turn) * pixel_m;
                wall.row(h_m, pixel_m, &mut row);
                for (x, value) in row.iter().enumerate() {
                    let expected = (10 + 2 * (x % 20) as i32 + 3 * y) as f32;
                    assert!((value - expected).abs() < 0.01, "{x} {y}: {value}");
                }
            }
        }
    }

    #[test]
    fn a_missing_picture_is_named() {
        let error = PictureWall::open(Path::new("no-such.png"), 1.0, 6.0)
            .err()
            .unwrap();
        assert!(error.to_string().starts_with("no-such.png: "), "{error}");
    }
}
