//! Maps of the wall as heat maps.

use super::error::ReportError;
use super::pictures::encode_picture;
use image::codecs::png::PngEncoder;
use image::{Rgba, RgbaImage};

/// Eight nodes of the colour map cividis, which is uniform for colour-blind readers, too.
///
/// Source: J. R. Nuñez, C. R. Anderton, R. S. Renslow, "Optimizing colormaps with consideration for
/// color vision deficiency", PLOS ONE 13(7), 2018.
const CIVIDIS: [[u8; 3]; 8] = [
    [0, 34, 78],
    [39, 61, 109],
    [79, 87, 108],
    [109, 114, 116],
    [139, 137, 121],
    [175, 164, 112],
    [213, 193, 94],
    [254, 232, 56],
];

/// Mapping from values to the colour map.
#[derive(Clone, Copy, Debug)]
pub struct ColourScale {
    /// Values of the darkest and the brightest colour.
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

/// Colour at a position on the scale, 0–1.
pub fn colour(share: f64) -> [u8; 3] {
    let position = share.clamp(0.0, 1.0) * (CIVIDIS.len() - 1) as f64;
    let below = (position.floor() as usize).min(CIVIDIS.len() - 2);
    let part = position - below as f64;
    let mix = |c: usize| {
        let (a, b) = (
            f64::from(CIVIDIS[below][c]),
            f64::from(CIVIDIS[below + 1][c]),
        );
        (a + part * (b - a)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

/// The scale as a CSS gradient, from left to right.
pub fn gradient() -> String {
    let stops: Vec<String> = CIVIDIS
        .iter()
        .map(|[red, green, blue]| format!("rgb({red} {green} {blue})"))
        .collect();
    format!("linear-gradient(to right, {})", stops.join(", "))
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
                let [red, green, blue] = colour(scale.share(value));
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
    fn colours_grow_brighter_along_the_scale() {
        let brightness = |share: f64| {
            let [red, green, blue] = colour(share).map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        let steps: Vec<f64> = (0..=50).map(|k| brightness(f64::from(k) / 50.0)).collect();
        assert!(steps.is_sorted(), "{steps:?}");
        assert_eq!((colour(-1.0), colour(2.0)), (CIVIDIS[0], CIVIDIS[7]));
    }

    #[test]
    fn a_map_lies_with_the_chainage_to_the_right_and_the_angle_up() {
        let scale = ColourScale {
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
        assert_eq!(picture.get_pixel(2, 1).0[..3], CIVIDIS[7]);
        assert_eq!(picture.get_pixel(1, 0).0[3], 0);
        assert_eq!(picture.get_pixel(0, 0).0[..3], CIVIDIS[0]);
        assert!((scale.share(10.0) - 0.5).abs() < 1e-12);
    }
}
