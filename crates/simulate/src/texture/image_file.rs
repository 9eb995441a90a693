//! Texture of an image file that repeats over the wall.

use crate::error::SimulateError;
use crate::texture::wall_texture::WallTexture;
use image::DynamicImage;
use std::path::Path;
use tunnelstitch_core::frames::{GreyImage, open_picture};

/// An image that repeats along s and h, upright and unmirrored as seen from inside.
///
/// The image's x axis runs along s, its y axis along h.
pub(super) struct ImageWall {
    image: GreyImage,
    /// Size of an image pixel on the wall, metres.
    pixel_m: f64,
}

/// Maximum samples along each side of a texel, for images finer than the texels.
const MAX_SAMPLES_PER_AXIS: f64 = 16.0;

impl ImageWall {
    /// Reads the image; `width_m` is adjusted so that a whole number fits around.
    ///
    /// # Errors
    /// [`SimulateError::Texture`] for a file that cannot be read or decoded.
    pub fn open(path: &Path, width_m: f64, perimeter_m: f64) -> Result<Self, SimulateError> {
        let fail = |what: String| SimulateError::Texture {
            path: path.to_owned(),
            what,
        };
        let image = open_picture(path)
            .and_then(DynamicImage::from_decoder)
            .map_err(|error| fail(error.to_string()))?;
        let grey = image.to_luma32f();
        let (width, height) = (grey.width() as usize, grey.height() as usize);
        if width < 2 || height < 2 {
            return Err(fail(format!("{width} × {height} px are no texture")));
        }
        let data = grey.into_raw().into_iter().map(|v| v * 255.0).collect();
        let around = (perimeter_m / width_m).round().max(1.0);
        Ok(Self {
            image: GreyImage::new(width, height, data),
            pixel_m: perimeter_m / around / width as f64,
        })
    }

    /// Interpolates bilinearly with periodic borders; `x`, `y` in pixels from the image's corner.
    fn sample(&self, x: f64, y: f64) -> f32 {
        let (width, height) = (self.image.width(), self.image.height());
        let cell = |x: f64, size: usize| {
            let x = (x - 0.5).rem_euclid(size as f64);
            let first = (x as usize).min(size - 1);
            (first, (first + 1) % size, (x - first as f64) as f32)
        };
        let (x0, x1, fx) = cell(x, width);
        let (y0, y1, fy) = cell(y, height);
        let across = |y: usize| {
            let (a, b) = (self.image.at(x0, y), self.image.at(x1, y));
            a + (b - a) * fx
        };
        let (a, b) = (across(y0), across(y1));
        a + (b - a) * fy
    }
}

impl WallTexture for ImageWall {
    fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
        let texel = texel_m / self.pixel_m;
        let n = texel.ceil().clamp(1.0, MAX_SAMPLES_PER_AXIS) as usize;
        let offset = |k: usize| texel * ((k as f64 + 0.5) / n as f64 - 0.5);
        let y = h_m / self.pixel_m;
        for (k, value) in row.iter_mut().enumerate() {
            let x = (k as f64 + 0.5) * texel;
            let mut sum = 0.0;
            for j in 0..n {
                for i in 0..n {
                    sum += self.sample(x + offset(i), y + offset(j));
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
    fn the_image_is_upright_and_repeats() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("wall.png");
        // Brighter to the right by 2 and downwards by 3 a pixel.
        image::GrayImage::from_fn(20, 10, |x, y| image::Luma([(10 + 2 * x + 3 * y) as u8]))
            .save(&path)
            .unwrap();
        // Three images of 2 m fit around 6.2 m: pixels of 10 cm become 10.33 cm.
        let wall = ImageWall::open(&path, 2.0, 6.2).unwrap();
        let pixel_m = 6.2 / 60.0;
        let mut row = vec![0.0; 60];
        for y in [0, 4, 9] {
            for turn in [-1.0, 0.0, 2.0] {
                let h_m = (f64::from(y) + 0.5 + 10.0 * turn) * pixel_m;
                wall.fill_row(h_m, pixel_m, &mut row);
                for (x, value) in row.iter().enumerate() {
                    let expected = (10 + 2 * (x % 20) as i32 + 3 * y) as f32;
                    assert!((value - expected).abs() < 0.01, "{x} {y}: {value}");
                }
            }
        }
    }

    #[test]
    fn a_missing_image_is_named() {
        let error = ImageWall::open(Path::new("no-such.png"), 1.0, 6.0)
            .err()
            .unwrap();
        assert!(error.to_string().starts_with("no-such.png: "), "{error}");
    }
}
