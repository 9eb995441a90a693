//! A decoded picture and its values between the pixels.

use image::DynamicImage;
use serde::Serialize;

/// How values between pixel centres are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Weighted mean of the 2 × 2 pixels around; soft.
    Bilinear,
    /// Catmull–Rom cubic through the 4 × 4 pixels around; keeps the frames' sharpness, exact for
    /// quadratics, may overshoot at edges.
    #[default]
    Bicubic,
}

/// A picture of 8-bit samples, row-major, channels interleaved: 1 (grey) or 3 (red, green, blue).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    width: usize,
    height: usize,
    channels: usize,
    data: Vec<u8>,
}

impl Picture {
    /// A picture from its samples.
    ///
    /// # Panics
    /// If `channels` is neither 1 nor 3 or `data` does not hold `width · height · channels` samples.
    pub fn new(width: usize, height: usize, channels: usize, data: Vec<u8>) -> Self {
        assert!(channels == 1 || channels == 3, "grey or colour");
        assert_eq!(
            data.len(),
            width * height * channels,
            "samples of a picture"
        );
        Self {
            width,
            height,
            channels,
            data,
        }
    }

    /// A decoded file: grey stays grey, everything else becomes colour; transparency is ignored, 16-bit
    /// samples are rounded to 8.
    pub fn from_decoded(decoded: DynamicImage) -> Self {
        let (width, height) = (decoded.width() as usize, decoded.height() as usize);
        if decoded.color().has_color() {
            Self::new(width, height, 3, decoded.into_rgb8().into_raw())
        } else {
            Self::new(width, height, 1, decoded.into_luma8().into_raw())
        }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Samples a pixel: 1 or 3.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The same picture with three channels.
    pub fn into_colour(self) -> Self {
        if self.channels == 3 {
            return self;
        }
        let data = self.data.iter().flat_map(|value| [*value; 3]).collect();
        Self::new(self.width, self.height, 3, data)
    }

    /// Half the size: the mean of 2 × 2 pixels; an odd last row or column is dropped (see
    /// [`crate::camera::Pinhole::at_level`]).
    pub fn halved(&self) -> Self {
        let (width, height, c) = (self.width / 2, self.height / 2, self.channels);
        let stride = self.width * c;
        let mut data = Vec::with_capacity(width * height * c);
        for y in 0..height {
            let upper = &self.data[2 * y * stride..(2 * y + 1) * stride];
            let lower = &self.data[(2 * y + 1) * stride..(2 * y + 2) * stride];
            for x in 0..width {
                for k in 0..c {
                    let (a, b) = (2 * x * c + k, (2 * x + 1) * c + k);
                    let sum = u16::from(upper[a])
                        + u16::from(upper[b])
                        + u16::from(lower[a])
                        + u16::from(lower[b]);
                    data.push(((sum + 2) / 4) as u8);
                }
            }
        }
        Self::new(width, height, c, data)
    }

    /// The value at pixel `(u, v)`, which must lie within the outermost pixel centres. Pixels beyond the
    /// border repeat the outermost one.
    ///
    /// `C` must be the number of channels.
    #[inline]
    pub fn sample<const C: usize>(&self, u: f64, v: f64, interpolation: Interpolation) -> [f32; C] {
        match interpolation {
            Interpolation::Bilinear => self.weighted::<C, 2>(u, v, 0, |t| [1.0 - t, t]),
            Interpolation::Bicubic => self.weighted::<C, 4>(u, v, 1, catmull_rom),
        }
    }

    /// `Σ_y w_y Σ_x w_x I(x, y)` over the `N × N` pixels of which `before` lie before `(u, v)`'s own.
    #[inline]
    fn weighted<const C: usize, const N: usize>(
        &self,
        u: f64,
        v: f64,
        before: usize,
        weights: impl Fn(f32) -> [f32; N],
    ) -> [f32; C] {
        debug_assert_eq!(C, self.channels);
        // Never the last pixel as the first of a pair, so that (width − 1, ·) has a right neighbour.
        let x = (u as usize).min(self.width.saturating_sub(2));
        let y = (v as usize).min(self.height.saturating_sub(2));
        let (w_x, w_y) = (
            weights((u - x as f64) as f32),
            weights((v - y as f64) as f32),
        );
        let mut value = [0.0; C];
        let after = N - before;
        if x >= before && y >= before && x + after <= self.width && y + after <= self.height {
            let mut start = ((y - before) * self.width + x - before) * C;
            for w in w_y {
                let row = &self.data[start..start + N * C];
                for c in 0..C {
                    let mut sum = 0.0;
                    for k in 0..N {
                        sum += w_x[k] * f32::from(row[k * C + c]);
                    }
                    value[c] += w * sum;
                }
                start += self.width * C;
            }
            return value;
        }
        for (j, w) in w_y.iter().enumerate() {
            let row = (y + j).saturating_sub(before).min(self.height - 1) * self.width;
            for (k, w_across) in w_x.iter().enumerate() {
                let at = (row + (x + k).saturating_sub(before).min(self.width - 1)) * C;
                for (c, value) in value.iter_mut().enumerate() {
                    *value += w * w_across * f32::from(self.data[at + c]);
                }
            }
        }
        value
    }

    /// The grey value at pixel `(u, v)`, bilinear: Rec. 709 luma of colour pictures.
    pub fn grey(&self, u: f64, v: f64) -> f32 {
        if self.channels == 1 {
            self.sample::<1>(u, v, Interpolation::Bilinear)[0]
        } else {
            luma(self.sample::<3>(u, v, Interpolation::Bilinear))
        }
    }
}

/// Rec. 709 luma: `0.2126 R + 0.7152 G + 0.0722 B`.
pub(crate) fn luma([red, green, blue]: [f32; 3]) -> f32 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// Weights of the pixels at −1, 0, 1, 2 for a point at `t ∈ [0, 1]`: the cubic through the middle two whose
/// slopes there are central differences.
///
/// Source: E. Catmull, R. Rom, "A class of local interpolating splines", 1974 (a = −½ in Keys' kernel).
fn catmull_rom(t: f32) -> [f32; 4] {
    [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parabola() -> Picture {
        let data = (0..10 * 9)
            .map(|k| (2 * (k % 10) * (k % 10) + 5 * (k / 10)) as u8)
            .collect();
        Picture::new(10, 9, 1, data)
    }

    #[test]
    fn bicubic_is_exact_for_quadratics_inside() {
        for (u, v) in [(3.25, 4.5), (1.0, 1.0), (6.75, 5.125)] {
            let [value] = parabola().sample::<1>(u, v, Interpolation::Bicubic);
            assert!(
                (f64::from(value) - (2.0 * u * u + 5.0 * v)).abs() < 1e-3,
                "{value}"
            );
        }
    }

    #[test]
    fn pixel_centres_give_the_pixels_up_to_the_border() {
        let picture = parabola();
        for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
            for (x, y) in [(0, 0), (9, 0), (0, 8), (9, 8), (4, 4)] {
                let [value] = picture.sample::<1>(f64::from(x), f64::from(y), interpolation);
                assert!((value - (2 * x * x + 5 * y) as f32).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn channels_do_not_mix() {
        let data = (0..8 * 8).flat_map(|k| [k as u8, 100, 200]).collect();
        let picture = Picture::new(8, 8, 3, data);
        for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
            for (u, v) in [(0.5, 0.5), (3.5, 3.5), (6.9, 6.9)] {
                let [_, green, blue] = picture.sample::<3>(u, v, interpolation);
                assert!((green - 100.0).abs() < 1e-3 && (blue - 200.0).abs() < 1e-3);
            }
        }
        let grey = Picture::new(2, 2, 1, vec![1, 2, 3, 4]).into_colour();
        assert!((grey.grey(0.5, 0.5) - 2.5).abs() < 1e-5);
    }

    #[test]
    fn halving_averages_and_drops_the_odd_row() {
        let half = Picture::new(4, 3, 1, vec![0, 4, 8, 8, 8, 12, 8, 8, 99, 99, 99, 99]).halved();
        assert_eq!(half, Picture::new(2, 1, 1, vec![6, 8]));
    }
}
