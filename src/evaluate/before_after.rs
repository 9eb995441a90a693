//! One small picture that shows what the refinement did.

use image::imageops::{self, FilterType};
use image::{DynamicImage, Rgb, RgbImage};

/// Width of the picture at the most, pixels.
const WIDTH: u32 = 1200;
/// Height of each half over its width, at the most.
const ASPECT: f64 = 0.3;
/// White rows between the halves.
const GAP: u32 = 12;

/// The middle stretch of two panoramas of the same canvas, `before` above `after`, on white.
///
/// Both are cropped to the same rows and shrunk by the same factor, so what lies at the same place
/// of the halves lies at the same place on the wall.
pub fn before_after(before: &DynamicImage, after: &DynamicImage) -> RgbImage {
    let (columns, rows) = (before.width().max(1), before.height().max(1));
    let stretch = rows.min(((f64::from(columns) * ASPECT) as u32).max(1));
    let first_row = (rows - stretch) / 2;
    let width = columns.min(WIDTH);
    let shrink = f64::from(width) / f64::from(columns);
    let height = ((f64::from(stretch) * shrink).round() as u32).max(1);
    let mut picture = RgbImage::from_pixel(width, 2 * height + GAP, Rgb([255; 3]));
    for (half, top) in [(before, 0), (after, i64::from(height + GAP))] {
        let part = half.crop_imm(0, first_row, columns, stretch).to_rgba8();
        let part = imageops::resize(&part, width, height, FilterType::Triangle);
        let mut on_white = image::RgbaImage::from_pixel(width, height, image::Rgba([255; 4]));
        imageops::overlay(&mut on_white, &part, 0, 0);
        let on_white = DynamicImage::from(on_white).to_rgb8();
        imageops::replace(&mut picture, &on_white, 0, top);
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayAlphaImage, LumaA};

    #[test]
    fn halves_are_aligned_and_holes_are_white() {
        let mut before = GrayAlphaImage::from_pixel(2400, 2000, LumaA([40, 255]));
        let after = GrayAlphaImage::from_pixel(2400, 2000, LumaA([80, 255]));
        for (_, _, pixel) in before.enumerate_pixels_mut().filter(|(x, ..)| *x < 600) {
            *pixel = LumaA([0, 0]);
        }
        let picture = before_after(&before.into(), &after.into());
        assert_eq!(picture.dimensions(), (1200, 2 * 360 + GAP));
        assert_eq!(picture.get_pixel(100, 100).0, [255; 3]);
        assert_eq!(picture.get_pixel(900, 100).0, [40; 3]);
        assert_eq!(picture.get_pixel(100, 360 + GAP / 2).0, [255; 3]);
        assert_eq!(picture.get_pixel(100, 360 + GAP).0, [80; 3]);
    }

    #[test]
    fn small_panoramas_are_shown_whole() {
        let flat = DynamicImage::from(GrayAlphaImage::from_pixel(50, 10, LumaA([9, 255])));
        assert_eq!(before_after(&flat, &flat).dimensions(), (50, 20 + GAP));
    }
}
