//! A decoded picture and its values between the pixels.

use super::pixel_format::{PixelFormat, luma};
use super::sample::{PADDING, Sample, Samples};
use image::DynamicImage;
use nalgebra::Vector2;
use tunnelstitch_core::frames::PyramidMask;
use tunnelstitch_geometry::numerics::kernel::Kernel;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// A picture of 8- or 16-bit samples, row-major, channels interleaved: 1 (grey) or 3 (red, green,
/// blue).
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    width: usize,
    height: usize,
    channels: usize,
    /// Samples and [`PADDING`] zeros: several are read at once.
    samples: Samples,
    /// Pixels that show the wall; all if there is no mask.
    mask: Option<PyramidMask>,
}

impl Picture {
    /// Makes a picture of its samples.
    ///
    /// # Panics
    /// If `channels` is neither 1 nor 3 or there are not `width · height · channels` samples.
    pub fn new(width: usize, height: usize, channels: usize, samples: impl Into<Samples>) -> Self {
        let mut samples = samples.into();
        assert!(channels == 1 || channels == 3, "grey or colour");
        assert_eq!(
            samples.len(),
            width * height * channels,
            "samples of a picture"
        );
        match &mut samples {
            Samples::Eight(samples) => pad(samples),
            Samples::Sixteen(samples) => pad(samples),
        }
        Self {
            width,
            height,
            channels,
            samples,
            mask: None,
        }
    }

    /// Masks the picture: only the pixels that `mask` leaves show the wall.
    pub fn masked(self, mask: Option<PyramidMask>) -> Self {
        Self { mask, ..self }
    }

    /// Pixels that show the wall; all if there is no mask.
    pub(crate) fn mask(&self) -> Option<&PyramidMask> {
        self.mask.as_ref()
    }

    /// True if all pixels under a kernel at `(u, v)` show the wall.
    #[inline]
    pub fn shows(&self, u: f32, v: f32, kernel: &Kernel) -> bool {
        let mask = self.mask.as_ref();
        mask.is_none_or(|mask| mask.is_clear(u, v, kernel.reach_px()))
    }

    /// Converts a decoded file to the format of [`PixelFormat::of`]; transparency is ignored.
    pub fn from_decoded(decoded: DynamicImage) -> Self {
        let (width, height) = (decoded.width() as usize, decoded.height() as usize);
        let format = PixelFormat::of(decoded.color());
        let samples: Samples = match (format.channels, format.deep) {
            (1, false) => decoded.into_luma8().into_raw().into(),
            (1, true) => decoded.into_luma16().into_raw().into(),
            (_, false) => decoded.into_rgb8().into_raw().into(),
            (_, true) => decoded.into_rgb16().into_raw().into(),
        };
        Self::new(width, height, format.channels, samples)
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Channels and depth.
    pub fn format(&self) -> PixelFormat {
        PixelFormat {
            channels: self.channels,
            deep: matches!(self.samples, Samples::Sixteen(_)),
        }
    }

    /// Samples, and [`PADDING`] zeros at the end.
    pub(crate) fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Converts to a format that holds at least as much: grey becomes colour, and 8 bits become 16
    /// (65535 = 255 · 257).
    pub fn widened(self, format: PixelFormat) -> Self {
        let (width, height) = (self.width, self.height);
        let copies = if format.channels > self.channels {
            3
        } else {
            1
        };
        let count = width * height * self.channels;
        let channels = self.channels * copies;
        let mask = self.mask.clone();
        let widened = match self.samples {
            Samples::Eight(samples) if format.deep => {
                let samples = samples[..count].iter();
                let wide = samples.flat_map(|v| std::iter::repeat_n(257 * u16::from(*v), copies));
                Self::new(width, height, channels, wide.collect::<Vec<u16>>())
            }
            Samples::Eight(samples) if copies > 1 => {
                let wide = samples[..count].iter().flat_map(|v| [*v; 3]);
                Self::new(width, height, channels, wide.collect::<Vec<u8>>())
            }
            Samples::Sixteen(samples) if copies > 1 => {
                let wide = samples[..count].iter().flat_map(|v| [*v; 3]);
                Self::new(width, height, channels, wide.collect::<Vec<u16>>())
            }
            samples => Self { samples, ..self },
        };
        widened.masked(mask)
    }

    /// Halves the size by the mean of 2 × 2 pixels; an odd last row or column is dropped (see
    /// [`tunnelstitch_geometry::camera::Camera::at_level`]).
    pub fn halved(&self) -> Self {
        let size = (self.width / 2, self.height / 2);
        let samples = match &self.samples {
            Samples::Eight(samples) => Samples::from(self.mean(samples)),
            Samples::Sixteen(samples) => Samples::from(self.mean(samples)),
        };
        let half = Self::new(size.0, size.1, self.channels, samples);
        half.masked(self.mask.as_ref().map(|mask| mask.halved(1)))
    }

    /// Averages `2^level × 2^level` pixels to one of 16 bits; odd rows and columns at the end are
    /// dropped.
    pub(crate) fn thumbnail(&self, level: usize) -> Self {
        let (width, height) = (self.width >> level, self.height >> level);
        let data = match &self.samples {
            Samples::Eight(samples) => self.sums(samples, level, 257.0),
            Samples::Sixteen(samples) => self.sums(samples, level, 1.0),
        };
        let small = Self::new(width, height, self.channels, data);
        small.masked(self.mask.as_ref().map(|mask| mask.halved(level)))
    }

    fn sums<T: Sample>(&self, samples: &[T], level: usize, scale: f32) -> Vec<u16> {
        let (width, height, c) = (self.width >> level, self.height >> level, self.channels);
        let edge = 1 << level;
        let factor = scale / (edge * edge) as f32;
        let mut sums = vec![0.0f32; width * edge * c];
        let mut data = Vec::with_capacity(width * height * c + PADDING);
        for y in 0..height {
            sums.fill(0.0);
            // Down the columns first, side by side.
            for row in 0..edge {
                let row = &samples[(y * edge + row) * self.width * c..][..width * edge * c];
                dispatch_simd(
                    #[inline(always)]
                    || {
                        for (sum, sample) in sums.iter_mut().zip(row) {
                            *sum += sample.value();
                        }
                    },
                );
            }
            for block in sums.chunks_exact(edge * c) {
                for channel in 0..c {
                    let sum: f32 = block.iter().skip(channel).step_by(c).sum();
                    data.push(u16::nearest(factor * sum));
                }
            }
        }
        data
    }

    fn mean<T: Sample>(&self, samples: &[T]) -> Vec<T> {
        let (width, height, c) = (self.width / 2, self.height / 2, self.channels);
        let stride = self.width * c;
        let mut data = Vec::with_capacity(width * height * c + PADDING);
        for y in 0..height {
            let upper = &samples[2 * y * stride..][..stride];
            let lower = &samples[(2 * y + 1) * stride..][..stride];
            for x in 0..width {
                for k in 0..c {
                    let (a, b) = (2 * x * c + k, (2 * x + 1) * c + k);
                    let sum =
                        upper[a].value() + upper[b].value() + lower[a].value() + lower[b].value();
                    data.push(T::nearest(0.25 * sum));
                }
            }
        }
        data
    }

    /// Value at pixel `(u, v)`, which must lie within the outermost pixel centres. Pixels beyond
    /// the border repeat the outermost one. A grey picture has it in all three channels.
    pub fn at(&self, u: f32, v: f32, kernel: &Kernel) -> [f32; 3] {
        let weights = |t: f32| {
            let t = t + kernel.rounding();
            let whole = t.floor();
            (whole as i64, kernel.at(Kernel::phase(t - whole) as usize))
        };
        let ((x, w_x), (y, w_y)) = (weights(u), weights(v));
        let pixel = |at: i64, size: usize| at.clamp(0, size as i64 - 1) as usize;
        let mut value = [0.0; 3];
        for (j, w_y) in w_y.iter().enumerate() {
            let row = pixel(y + j as i64 - kernel.taps_before() as i64, self.height) * self.width;
            let mut sum = [0.0; 3];
            for (k, w_x) in w_x.iter().enumerate() {
                let column = pixel(x + k as i64 - kernel.taps_before() as i64, self.width);
                let first = (row + column) * self.channels;
                for (c, sum) in sum.iter_mut().enumerate() {
                    let sample = first + c.min(self.channels - 1);
                    *sum += w_x
                        * match &self.samples {
                            Samples::Eight(samples) => samples[sample].value(),
                            Samples::Sixteen(samples) => samples[sample].value(),
                        };
                }
            }
            for (value, sum) in value.iter_mut().zip(sum) {
                *value += w_y * sum;
            }
        }
        value
    }

    /// Grey value at a pixel, 0 to 255, bilinear: Rec. 709 luma of colour pictures.
    pub fn grey(&self, pixel: &Vector2<f64>, bilinear: &Kernel) -> f32 {
        let value = self.at(pixel.x as f32, pixel.y as f32, bilinear);
        luma(value) * (255.0 / self.format().white())
    }
}

fn pad<T: Sample>(samples: &mut Vec<T>) {
    samples.reserve_exact(PADDING);
    samples.extend([T::default(); PADDING]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::numerics::kernel::Interpolation;

    fn parabola() -> Picture {
        let data: Vec<u8> = (0..10 * 9)
            .map(|k| (2 * (k % 10) * (k % 10) + 5 * (k / 10)) as u8)
            .collect();
        Picture::new(10, 9, 1, data)
    }

    fn at(picture: &Picture, u: f64, v: f64, interpolation: Interpolation) -> [f64; 3] {
        let kernel = Kernel::new(interpolation, 1.0);
        picture.at(u as f32, v as f32, &kernel).map(f64::from)
    }

    #[test]
    fn bicubic_is_exact_for_quadratics_inside() {
        for (u, v) in [(3.25, 4.5), (1.0, 1.0), (6.75, 5.125)] {
            let [value, ..] = at(&parabola(), u, v, Interpolation::Bicubic);
            assert!((value - (2.0 * u * u + 5.0 * v)).abs() < 1e-3, "{value}");
        }
    }

    #[test]
    fn pixel_centres_give_the_pixels_up_to_the_border() {
        use Interpolation::{Bicubic, Bilinear, Lanczos3, Nearest};
        for interpolation in [Nearest, Bilinear, Bicubic, Lanczos3] {
            for (x, y) in [(0, 0), (9, 0), (0, 8), (9, 8), (4, 4)] {
                let [value, ..] = at(&parabola(), f64::from(x), f64::from(y), interpolation);
                assert!((value - f64::from(2 * x * x + 5 * y)).abs() < 1e-3);
            }
        }
        assert_eq!(at(&parabola(), 3.4, 3.6, Interpolation::Nearest)[0], 38.0);
    }

    #[test]
    fn channels_do_not_mix() {
        let data: Vec<u8> = (0..8 * 8).flat_map(|k| [k as u8, 100, 200]).collect();
        let picture = Picture::new(8, 8, 3, data);
        for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
            for (u, v) in [(0.5, 0.5), (3.5, 3.5), (6.9, 6.9)] {
                let [_, green, blue] = at(&picture, u, v, interpolation);
                assert!((green - 100.0).abs() < 1e-3 && (blue - 200.0).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn widening_keeps_the_values() {
        let narrow = Picture::new(2, 2, 1, vec![1u8, 2, 3, 4]);
        let wide = narrow.clone().widened(PixelFormat {
            channels: 3,
            deep: true,
        });
        assert_eq!(wide.format().pixel_bytes(true), 8);
        let bilinear = Kernel::new(Interpolation::Bilinear, 1.0);
        let middle = Vector2::new(0.5, 0.5);
        assert!((narrow.grey(&middle, &bilinear) - 2.5).abs() < 1e-5);
        assert!((wide.grey(&middle, &bilinear) - 2.5).abs() < 1e-4);
        assert_eq!(
            wide.clone().widened(narrow.format().and(wide.format())),
            wide
        );
    }

    #[test]
    fn halving_averages_and_drops_the_odd_row() {
        let picture: Vec<u8> = vec![0, 4, 8, 8, 8, 12, 8, 8, 99, 99, 99, 99];
        let half = Picture::new(4, 3, 1, picture).halved();
        assert_eq!(half, Picture::new(2, 1, 1, vec![6u8, 8]));
    }
}
