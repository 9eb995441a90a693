//! Masks of pixels that never show the wall in any frame, such as the carrier's shaft or the rim of
//! a housing.

use super::error::FrameError;
use super::grey::GreyImage;
use super::picture_decoder::open_picture;
use image::{DynamicImage, GrayImage, ImageDecoder, ImageError, Luma};
use std::path::Path;
use std::sync::Arc;
use tunnelstitch_geometry::camera::Camera;

/// Smallest grey level (of 255) of a mask pixel that shows the wall.
const MIN_WALL_GREY: u8 = 128;
/// Grey levels (of 255) that are neither black nor white.
const UNDECIDED_GREY: std::ops::Range<u8> = 32..224;
/// Largest fraction of such pixels in a mask.
const MAX_UNDECIDED_FRACTION: f64 = 0.1;

/// A mask common to all frames, at full resolution.
///
/// Stored as the distance of each pixel to the nearest masked pixel, so that one look-up decides
/// whether a kernel of any width is free of masked pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: usize,
    height: usize,
    /// `max(|Δu|, |Δv|)` to the nearest masked pixel, 0 for masked pixels; row-major.
    distance_px: Vec<u16>,
    hidden: usize,
}

impl Mask {
    /// Reads a mask: white shows the wall, black does not.
    ///
    /// # Errors
    /// [`FrameError::Mask`]: an unreadable file, a size other than the frames', an image that is
    /// not black and white or is entirely black.
    pub fn read(path: &Path, width: u32, height: u32) -> Result<Self, FrameError> {
        let fail = |what: String| FrameError::Mask {
            path: path.to_owned(),
            what,
        };
        let undecodable = |error: ImageError| fail(format!("{error}; save it as a PNG file"));
        let decoder = open_picture(path).map_err(|error| match error {
            ImageError::IoError(error) => fail(format!(
                "{error}; draw a mask, or take frames.mask out of survey.toml"
            )),
            error => undecodable(error),
        })?;
        // Checked before allocating the memory that the header claims.
        let found = decoder.dimensions();
        if found != (width, height) {
            return Err(fail(format!(
                "{} × {} px, but the frames have {width} × {height} px; a mask is an image of the \
                 frames' size",
                found.0, found.1
            )));
        }
        let picture = DynamicImage::from_decoder(decoder).map_err(undecodable)?;
        if picture.to_rgba8().pixels().any(|pixel| pixel.0[3] != 255) {
            return Err(fail(
                "has transparent pixels; save it without transparency, black where the wall is \
                 hidden and white elsewhere"
                    .to_owned(),
            ));
        }
        let coloured = |rgb: [u8; 3]| {
            rgb.iter()
                .any(|c| c.abs_diff(rgb[0]) > UNDECIDED_GREY.start)
        };
        let colour = picture.to_rgb8();
        let grey = picture.to_luma8();
        let pixels = colour.pixels().zip(grey.pixels());
        let odd =
            pixels.filter(|(rgb, grey)| coloured(rgb.0) || UNDECIDED_GREY.contains(&grey.0[0]));
        let share = odd.count() as f64 / grey.len() as f64;
        if share > MAX_UNDECIDED_FRACTION {
            return Err(fail(format!(
                "{:.0} % of its pixels are neither black nor white; a mask is black where the \
                 frames never show the wall and white \
                 elsewhere",
                100.0 * share
            )));
        }
        let wall: Vec<bool> = grey
            .pixels()
            .map(|grey| grey.0[0] >= MIN_WALL_GREY)
            .collect();
        if !wall.contains(&true) {
            return Err(fail(
                "is black all over, so that no pixel would show the wall; black is what does not, \
                 and white the wall: invert it"
                    .to_owned(),
            ));
        }
        Ok(Self::new(width as usize, height as usize, &wall))
    }

    /// Creates a mask from its pixels, row-major: true for pixels that show the wall.
    ///
    /// The distance `max(|Δu|, |Δv|)` is computed in two passes over the eight neighbours: first
    /// those before the pixel in row order, then those after it.
    ///
    /// Source: A. Rosenfeld, J. L. Pfaltz, "Distance functions on digital pictures", Pattern
    /// Recognition 1, 1968.
    ///
    /// # Panics
    /// If `wall` does not hold `width · height` pixels.
    pub fn new(width: usize, height: usize, wall: &[bool]) -> Self {
        assert_eq!(wall.len(), width * height, "pixels of a mask");
        let mut distance_px: Vec<u16> =
            wall.iter().map(|w| if *w { u16::MAX } else { 0 }).collect();
        let pixels = wall.len();
        let place = |k: usize| (k % width, k / width);
        for k in 0..pixels {
            let (u, v) = place(k);
            let mut nearest = distance_px[k];
            let mut step =
                |other: usize| nearest = nearest.min(distance_px[other].saturating_add(1));
            if u > 0 {
                step(k - 1);
            }
            if v > 0 {
                step(k - width);
                if u > 0 {
                    step(k - width - 1);
                }
                if u + 1 < width {
                    step(k - width + 1);
                }
            }
            distance_px[k] = nearest;
        }
        for k in (0..pixels).rev() {
            let (u, v) = place(k);
            let mut nearest = distance_px[k];
            let mut step =
                |other: usize| nearest = nearest.min(distance_px[other].saturating_add(1));
            if u + 1 < width {
                step(k + 1);
            }
            if v + 1 < height {
                step(k + width);
                if u + 1 < width {
                    step(k + width + 1);
                }
                if u > 0 {
                    step(k + width - 1);
                }
            }
            distance_px[k] = nearest;
        }
        Self {
            width,
            height,
            distance_px,
            hidden: wall.iter().filter(|wall| !**wall).count(),
        }
    }

    /// The mask that hides the pixels of both masks.
    ///
    /// # Panics
    /// If the masks have different sizes.
    pub fn union(&self, other: &Self) -> Self {
        let pixels = self.distance_px.iter().zip(&other.distance_px);
        let wall: Vec<bool> = pixels.map(|(a, b)| *a > 0 && *b > 0).collect();
        Self::new(self.width, self.height, &wall)
    }

    /// The mask as a picture: black where the wall is hidden, white elsewhere.
    pub fn picture(&self) -> GrayImage {
        let (width, height) = (self.width as u32, self.height as u32);
        GrayImage::from_fn(width, height, |u, v| {
            let distance = self.distance_px[v as usize * self.width + u as usize];
            Luma([if distance > 0 { u8::MAX } else { 0 }])
        })
    }

    /// Fraction of masked pixels.
    pub fn masked_fraction(&self) -> f64 {
        self.hidden as f64 / self.distance_px.len().max(1) as f64
    }

    /// True if all pixels within `reach_px` of `(u, v)` along both axes show the wall. Pixels
    /// outside the image count as unmasked.
    #[inline]
    pub fn is_clear(&self, u: f32, v: f32, reach_px: f32) -> bool {
        // The casts saturate.
        let nearest = |at: f32, size: usize| ((at + 0.5) as usize).min(size - 1);
        let (x, y) = (nearest(u, self.width), nearest(v, self.height));
        // The nearest pixel's centre is at most half a pixel away.
        f32::from(self.distance_px[y * self.width + x]) > reach_px + 0.5
    }

    /// Removes the values of masked pixels from a full-resolution image.
    pub fn blank(&self, image: &mut GreyImage) {
        for (value, distance) in image.data_mut().iter_mut().zip(&self.distance_px) {
            if *distance == 0 {
                *value = f32::NAN;
            }
        }
    }
}

/// A [`Mask`] at a pyramid level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PyramidMask {
    mask: Arc<Mask>,
    level: u32,
}

impl PyramidMask {
    /// Creates the mask of level 0.
    pub fn new(mask: Arc<Mask>) -> Self {
        Self { mask, level: 0 }
    }

    /// The mask at `levels` further pyramid levels.
    pub fn halved(&self, levels: usize) -> Self {
        Self {
            mask: Arc::clone(&self.mask),
            level: self.level + levels as u32,
        }
    }

    /// Creates the mask at the pyramid level of `camera`.
    pub fn for_camera(mask: Arc<Mask>, camera: &Camera) -> Self {
        let level = (mask.width as f64 / f64::from(camera.width)).log2().round();
        Self {
            mask,
            level: level.max(0.0) as u32,
        }
    }

    /// [`Mask::is_clear`] in pixels of the level, each the mean of a square of full-resolution
    /// pixels: at full resolution, `u = 2^l u_l + (2^l − 1)/2`, and a pixel reaches `(2^l − 1)/2`
    /// to each side.
    #[inline]
    pub fn is_clear(&self, u: f32, v: f32, reach_px: f32) -> bool {
        let scale = (1u32 << self.level) as f32;
        let half = 0.5 * (scale - 1.0);
        let full = |at: f32| scale * at + half;
        self.mask
            .is_clear(full(u), full(v), scale * reach_px + half)
    }

    /// True if a pixel of the level covers no masked pixel at full resolution.
    pub fn is_wall(&self, u: usize, v: usize) -> bool {
        self.is_clear(u as f32, v as f32, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage, RgbaImage};

    /// Two bars and a dot, compared with a brute-force distance.
    #[test]
    fn a_kernel_is_clear_only_if_all_its_pixels_show_the_wall() {
        let (width, height) = (40, 30);
        let wall: Vec<bool> = (0..width * height)
            .map(|k| {
                let (u, v) = (k % width, k / width);
                !(v >= 28 || u == 12 && v > 9 || (u, v) == (30, 4))
            })
            .collect();
        let mask = Arc::new(Mask::new(width, height, &wall));
        let hidden = wall.iter().filter(|w| !**w).count();
        assert_eq!(mask.masked_fraction(), hidden as f64 / 1200.0);
        for level in 0..3 {
            let halved = PyramidMask::new(Arc::clone(&mask)).halved(level);
            let edge = 1usize << level;
            // All full-resolution pixels of the level's pixels within the reach.
            let all_wall = |u: f32, v: f32, reach: f32| {
                let within = |at: f32, k: usize| ((k / edge) as f32 - at).abs() <= reach;
                let hit = |k: &usize| within(u, k % width) && within(v, k / width);
                !(0..wall.len()).filter(hit).any(|k| !wall[k])
            };
            for (u, v) in (0..600).map(|k| (0.37 * (k % 27) as f32, 0.29 * (k / 27) as f32)) {
                for reach in [0.0, 1.0, 2.0] {
                    let clear = halved.is_clear(u, v, reach);
                    assert!(!clear || all_wall(u, v, reach), "{u} {v} {reach}");
                    // The error is at most one pixel.
                    assert!(clear || !all_wall(u, v, reach + 1.5), "{u} {v} {reach}");
                }
            }
            for (k, wall) in wall.iter().enumerate().filter(|_| level == 0) {
                assert_eq!(halved.is_wall(k % width, k / width), *wall);
            }
        }
    }

    #[test]
    fn hidden_pixels_have_no_value() {
        let mask = Mask::new(3, 1, &[true, false, true]);
        let mut image = GreyImage::new(3, 1, vec![5.0; 3]);
        mask.blank(&mut image);
        assert!(image.at(1, 0).is_nan() && image.at(0, 0) == 5.0 && image.at(2, 0) == 5.0);
    }

    #[test]
    fn masks_unite_and_are_pictures_of_themselves() {
        let first = Mask::new(3, 1, &[true, false, true]);
        let second = Mask::new(3, 1, &[true, true, false]);
        let both = first.union(&second);
        assert_eq!(both, Mask::new(3, 1, &[true, false, false]));
        assert_eq!(both.picture().into_raw(), [255, 0, 0]);
    }

    #[test]
    fn what_is_no_mask_is_refused_with_the_remedy() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mask.png");
        let read = |picture: DynamicImage| {
            picture.save(&path).unwrap();
            Mask::read(&path, 32, 24)
        };
        let half = |u: u32| if u < 8 { 0 } else { 255 };
        let good = GrayImage::from_fn(32, 24, |u, _| Luma([half(u)]));
        assert_eq!(read(good.into()).unwrap().masked_fraction(), 0.25);
        let colour = RgbImage::from_fn(32, 24, |u, _| Rgb([half(u); 3]));
        assert_eq!(read(colour.into()).unwrap().masked_fraction(), 0.25);
        let sixteen = image::ImageBuffer::from_fn(32, 24, |u, _| Luma([257 * u16::from(half(u))]));
        assert_eq!(
            read(DynamicImage::ImageLuma16(sixteen))
                .unwrap()
                .masked_fraction(),
            0.25
        );
        let bad: [(DynamicImage, &str); 5] = [
            (GrayImage::new(32, 24).into(), "invert it"),
            (
                GrayImage::from_pixel(30, 24, Luma([255])).into(),
                "30 × 24 px",
            ),
            (GrayImage::from_pixel(32, 24, Luma([100])).into(), "100 %"),
            (
                RgbImage::from_pixel(32, 24, Rgb([255, 0, 0])).into(),
                "neither black nor white",
            ),
            (RgbaImage::new(32, 24).into(), "transparen"),
        ];
        for (picture, expected) in bad {
            let message = read(picture).unwrap_err().to_string();
            assert!(
                message.contains("mask.png") && message.contains(expected),
                "{message}"
            );
        }
        std::fs::write(&path, "no picture").unwrap();
        assert!(Mask::read(&path, 32, 24).is_err());
        let message = Mask::read(&dir.path().join("none.png"), 32, 24).unwrap_err();
        assert!(message.to_string().contains("frames.mask"), "{message}");
    }
}
