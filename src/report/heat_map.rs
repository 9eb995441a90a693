//! Maps of the wall as heat maps.

use super::error::ReportError;
use super::pictures::encode_picture;
use image::codecs::png::PngEncoder;
use image::{Rgba, RgbaImage};
use tunnelstitch_core::colour_map::Palette;

/// Mapping from values to a colour map.
#[derive(Clone, Copy, Debug)]
pub struct ColourScale {
    /// The colours.
    pub palette: Palette,
    /// Values of the first and the last colour.
    pub range: [f64; 2],
    /// True if the scale is logarithmic.
    pub logarithmic: bool,
}

impl ColourScale {
    /// Position of a value on the scale, clamped to 0–1.
    pub fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        let share = if self.logarithmic {
            (value.max(low) / low).ln() / (high / low).ln()
        } else {
            (value - low) / (high - low)
        };
        if share.is_finite() {
            share.clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

/// Encodes a map as PNG, one pixel per cell: chainage to the right, θ up; cells without a value are
/// transparent.
///
/// `values` has `along` rows of `around` cells.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn png(
    name: &str,
    [around, along]: [usize; 2],
    values: &[Option<f64>],
    scale: &ColourScale,
) -> Result<Vec<u8>, ReportError> {
    let image = RgbaImage::from_fn(along as u32, around as u32, |x, y| {
        let at = x as usize * around + (around - 1 - y as usize);
        match values.get(at).copied().flatten() {
            Some(value) => {
                let [red, green, blue] = scale.palette.colour(scale.share(value));
                Rgba([red, green, blue, 255])
            }
            None => Rgba([0; 4]),
        }
    });
    encode_picture(name, |bytes| {
        image.write_with_encoder(PngEncoder::new(bytes))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_lies_with_the_chainage_to_the_right_and_the_angle_up() {
        let scale = ColourScale {
            palette: Palette::Cividis,
            range: [1.0, 100.0],
            logarithmic: true,
        };
        // Two cells around, three along: one bright at the end of the axis at θ = 0.
        let mut values = vec![Some(1.0); 6];
        values[4] = Some(100.0);
        values[3] = None;
        let picture = image::load_from_memory(&png("map", [2, 3], &values, &scale).unwrap());
        let picture = picture.unwrap().to_rgba8();
        assert_eq!(picture.dimensions(), (3, 2));
        assert_eq!(picture.get_pixel(2, 1).0[..3], Palette::Cividis.colour(1.0));
        assert_eq!(picture.get_pixel(1, 0).0[3], 0);
        assert_eq!(picture.get_pixel(0, 0).0[..3], Palette::Cividis.colour(0.0));
        assert!((scale.share(10.0) - 0.5).abs() < 1e-12);
    }
}
