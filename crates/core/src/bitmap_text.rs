//! Text drawn into pictures with a bitmap font of 8 × 8 pixels.

use font8x8::{BASIC_FONTS, GREEK_FONTS, LATIN_FONTS, UnicodeFonts};
use image::{Rgb, RgbImage};

/// Edge of a letter at scale 1, pixels.
pub const LETTER: u32 = 8;

/// Width of a text, pixels.
pub fn width(text: &str, scale: u32) -> u32 {
    text.chars().count() as u32 * LETTER * scale
}

/// Draws a text with its upper left corner at (x, y), pixels; what lies outside the picture is cut
/// off, and a letter that the font lacks becomes a question mark.
pub fn draw(image: &mut RgbImage, [x, y]: [u32; 2], text: &str, scale: u32, colour: Rgb<u8>) {
    for (k, letter) in text.chars().enumerate() {
        let rows = glyph(letter);
        let left = x + k as u32 * LETTER * scale;
        for v in 0..LETTER * scale {
            for u in 0..LETTER * scale {
                // The lowest bit is leftmost.
                let set = rows[(v / scale) as usize] >> (u / scale) & 1 == 1;
                if let Some(pixel) = image.get_pixel_mut_checked(left + u, y + v)
                    && set
                {
                    *pixel = colour;
                }
            }
        }
    }
}

fn glyph(letter: char) -> [u8; LETTER as usize] {
    BASIC_FONTS
        .get(letter)
        .or_else(|| LATIN_FONTS.get(letter))
        .or_else(|| GREEK_FONTS.get(letter))
        .unwrap_or_else(|| BASIC_FONTS.get('?').unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_drawn_the_right_way_round_and_cut_at_the_edge() {
        let mut image = RgbImage::new(20, 16);
        let white = Rgb([255; 3]);
        draw(&mut image, [0, 0], "LL", 2, white);
        let ink = |columns: std::ops::Range<u32>| {
            columns
                .flat_map(|u| (0..16).map(move |v| (u, v)))
                .filter(|(u, v)| *image.get_pixel(*u, *v) == white)
                .count()
        };
        // An L leans on its left.
        assert!(ink(0..8) > ink(8..16), "{} {}", ink(0..8), ink(8..16));
        assert!(ink(16..20) > 0);
        assert_eq!(width("LL", 2), 32);
        for letter in ['°', '×', '%', 'σ'] {
            assert_ne!(glyph(letter), glyph('?'), "{letter}");
        }
    }
}
