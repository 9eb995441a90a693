//! Small comparison image of a panorama before and after refinement.

use image::imageops::{self, FilterType};
use image::{DynamicImage, Rgb, RgbImage};

/// Maximum width of the image, pixels.
const MAX_WIDTH_PX: u32 = 1200;
/// Maximum ratio of height to width of each half.
const MAX_ASPECT: f64 = 0.3;
/// Number of white rows between the halves.
const GAP_ROWS: u32 = 12;

/// Draws the middle stretch of two panoramas of one canvas, `before` above `after`, on white.
///
/// Both are cropped to the same rows and scaled by the same factor, so that equal positions in the
/// halves are equal positions on the wall.
pub fn draw_before_after(before: &DynamicImage, after: &DynamicImage) -> RgbImage {
    let (columns, rows) = (before.width().max(1), before.height().max(1));
    let stretch = rows.min(((f64::from(columns) * MAX_ASPECT) as u32).max(1));
    let first_row = (rows - stretch) / 2;
    let width = columns.min(MAX_WIDTH_PX);
    let shrink = f64::from(width) / f64::from(columns);
    let height = ((f64::from(stretch) * shrink).round() as u32).max(1);
    let mut image = RgbImage::from_pixel(width, 2 * height + GAP_ROWS, Rgb([255; 3]));
    for (half, top) in [(before, 0), (after, i64::from(height + GAP_ROWS))] {
        let part = half.crop_imm(0, first_row, columns, stretch).to_rgba8();
        let part = imageops::resize(&part, width, height, FilterType::Triangle);
        let mut on_white = image::RgbaImage::from_pixel(width, height, image::Rgba([255; 4]));
        imageops::overlay(&mut on_white, &part, 0, 0);
        let on_white = DynamicImage::from(on_white).to_rgb8();
        imageops::replace(&mut image, &on_white, 0, top);
    }
    image
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
        let image = draw_before_after(&before.into(), &after.into());
        assert_eq!(image.dimensions(), (1200, 2 * 360 + GAP_ROWS));
        assert_eq!(image.get_pixel(100, 100).0, [255; 3]);
        assert_eq!(image.get_pixel(900, 100).0, [40; 3]);
        assert_eq!(image.get_pixel(100, 360 + GAP_ROWS / 2).0, [255; 3]);
        assert_eq!(image.get_pixel(100, 360 + GAP_ROWS).0, [80; 3]);
    }

    #[test]
    fn small_panoramas_are_shown_whole() {
        let flat = DynamicImage::from(GrayAlphaImage::from_pixel(50, 10, LumaA([9, 255])));
        assert_eq!(
            draw_before_after(&flat, &flat).dimensions(),
            (50, 20 + GAP_ROWS)
        );
    }
}
