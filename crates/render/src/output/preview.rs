//! A small panorama with its axes: chainage and clock position.

use crate::compositing::band::{Band, Target};
use crate::error::RenderError;
use crate::layout::canvas::{Canvas, Layout};
use crate::sampling::sample::{Sample, Samples};
use image::{Rgb, RgbImage};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use tunnelstitch_core::bitmap_text::{self, LETTER};
use tunnelstitch_geometry::surface::Surface;

/// Largest side of the preview, pixels.
const MAX_SIDE_PX: u32 = 4096;
/// Space for the axes, pixels.
const MARGIN_PX: u32 = 96;
/// Scale of the letters.
const TEXT_SCALE: u32 = 2;
/// Length of a tick, pixels.
const TICK_PX: u32 = 10;
/// Smallest distance of ticks along the chainage, pixels.
const MIN_TICK_DISTANCE_PX: f64 = 150.0;
const PAPER: Rgb<u8> = Rgb([255; 3]);
const INK: Rgb<u8> = Rgb([20; 3]);
/// Colour of wall that no frame sees.
const HOLE: Rgb<u8> = Rgb([205, 215, 235]);

/// Preview that bands are added to.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Preview {
    canvas: Canvas,
    /// Canvas pixels along each side of one of the preview's.
    shrink: u32,
    columns: usize,
    rows: usize,
    /// Red, green, blue of 255 and the number of covered pixels.
    sums: Vec<[f32; 4]>,
}

/// Canvas pixels along each side of one of the preview's.
fn shrink(canvas: &Canvas) -> u32 {
    let longest = canvas.columns.max(canvas.rows);
    longest.div_ceil(MAX_SIDE_PX - 2 * MARGIN_PX)
}

impl Preview {
    /// Memory for a canvas, bytes: the sums and the picture.
    pub fn bytes(canvas: &Canvas) -> u64 {
        let pixels = canvas.pixels() as u64 / u64::from(shrink(canvas)).pow(2);
        pixels * (size_of::<[f32; 4]>() as u64 + 3)
    }

    /// Makes a preview of which nothing has been drawn yet.
    pub fn new(canvas: &Canvas) -> Self {
        let shrink = shrink(canvas);
        let columns = canvas.columns.div_ceil(shrink) as usize;
        let rows = canvas.rows.div_ceil(shrink) as usize;
        Self {
            canvas: *canvas,
            shrink,
            columns,
            rows,
            sums: vec![[0.0; 4]; columns * rows],
        }
    }

    /// Adds what another one of the same canvas has received.
    pub fn absorb(&mut self, part: &Self) {
        for (own, part) in self.sums.iter_mut().zip(&part.sums) {
            for (own, part) in own.iter_mut().zip(part) {
                *own += part;
            }
        }
    }

    /// Draws the picture, at most 4096 px long, with chainage in metres along one side and clock
    /// positions along the other, twelve o'clock at θ = `twelve_at_deg`.
    pub fn picture(&self, surface: &dyn Surface, layout: Layout, twelve_at_deg: f64) -> RgbImage {
        let size = [self.columns as u32, self.rows as u32];
        let [width, height] = match layout {
            Layout::ThetaRight => size,
            Layout::ChainageRight => [size[1], size[0]],
        };
        let mut image = RgbImage::from_pixel(width + 2 * MARGIN_PX, height + 2 * MARGIN_PX, PAPER);
        for row in 0..self.rows {
            for column in 0..self.columns {
                let [red, green, blue, n] = self.sums[row * self.columns + column];
                let colour = if n > 0.0 {
                    Rgb([red, green, blue].map(|sum| u8::nearest(sum / n)))
                } else {
                    HOLE
                };
                let (x, y) = match layout {
                    Layout::ThetaRight => (column, row),
                    Layout::ChainageRight => (row, self.columns - 1 - column),
                };
                image.put_pixel(MARGIN_PX + x as u32, MARGIN_PX + y as u32, colour);
            }
        }
        let pixels = f64::from(self.shrink);
        let along = |h_m: f64| (h_m - self.canvas.h_start_m) * self.canvas.px_per_metre / pixels;
        for (h_m, text) in self.chainages() {
            axis(
                &mut image,
                layout == Layout::ChainageRight,
                along(h_m),
                &text,
            );
        }
        let around = f64::from(self.canvas.columns) / pixels;
        for hour in 0..12u32 {
            let angle_rad = TAU * (f64::from(hour) / 12.0 + twelve_at_deg / 360.0);
            let turn = surface.s_at_m(angle_rad) / surface.perimeter_m();
            let at = match layout {
                Layout::ThetaRight => turn * around,
                Layout::ChainageRight => (1.0 - turn) * around,
            };
            let name = if hour == 0 { 12 } else { hour };
            axis(
                &mut image,
                layout == Layout::ThetaRight,
                at,
                &format!("{name}:00"),
            );
        }
        image
    }

    /// Round chainages and their labels.
    fn chainages(&self) -> Vec<(f64, String)> {
        let [start_m, end_m] = self.canvas.chainage_m();
        let least_m = MIN_TICK_DISTANCE_PX * f64::from(self.shrink) / self.canvas.px_per_metre;
        let power = 10f64.powf(least_m.log10().floor());
        let step_m = [1.0, 2.0, 5.0, 10.0]
            .map(|factor| factor * power)
            .into_iter()
            .find(|step| *step >= least_m)
            .unwrap_or(10.0 * power);
        let decimals = (-step_m.log10().floor()).max(0.0) as usize;
        let first = (start_m / step_m).ceil() as i64;
        let last = (end_m / step_m).floor() as i64;
        (first..=last)
            .map(|k| {
                let h_m = k as f64 * step_m;
                (h_m, format!("{h_m:.decimals$} m"))
            })
            .collect()
    }
}

/// Draws a tick on both sides of the picture with its text: above and below if `across`, else left
/// and right.
fn axis(image: &mut RgbImage, across: bool, at: f64, text: &str) {
    let (width, height) = image.dimensions();
    let at = MARGIN_PX + at.max(0.0) as u32;
    let half = bitmap_text::width(text, TEXT_SCALE) / 2;
    for k in 0..TICK_PX {
        let ends = if across {
            [[at, MARGIN_PX - 1 - k], [at, height - MARGIN_PX + k]]
        } else {
            [[MARGIN_PX - 1 - k, at], [width - MARGIN_PX + k, at]]
        };
        for [x, y] in ends {
            if let Some(pixel) = image.get_pixel_mut_checked(x, y) {
                *pixel = INK;
            }
        }
    }
    let letter = LETTER * TEXT_SCALE;
    let places = if across {
        let x = at.saturating_sub(half);
        [
            [x, MARGIN_PX - TICK_PX - letter - 4],
            [x, height - MARGIN_PX + TICK_PX + 4],
        ]
    } else {
        let y = at.saturating_sub(letter / 2);
        [
            [(MARGIN_PX - TICK_PX).saturating_sub(2 * half + 4), y],
            [width - MARGIN_PX + TICK_PX + 4, y],
        ]
    };
    for place in places {
        bitmap_text::draw(image, place, text, TEXT_SCALE, INK);
    }
}

impl Target for Preview {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        match &band.samples {
            Samples::Eight(samples) => self.add(canvas, band, samples),
            Samples::Sixteen(samples) => self.add(canvas, band, samples),
        }
        Ok(())
    }
}

impl Preview {
    fn add<T: Sample>(&mut self, canvas: &Canvas, band: &Band, samples: &[T]) {
        let channels = band.format.channels;
        let scale = 255.0 / T::WHITE;
        let width = canvas.columns as usize;
        for (k, pixel) in samples.chunks_exact(channels + 1).enumerate() {
            if pixel[channels] == T::default() {
                continue;
            }
            let row = (band.row as usize + k / width) / self.shrink as usize;
            let column = k % width / self.shrink as usize;
            let sum = &mut self.sums[row * self.columns + column];
            for (c, sum) in sum.iter_mut().take(3).enumerate() {
                *sum += scale * pixel[c.min(channels - 1)].value();
            }
            sum[3] += 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::pixel_format::PixelFormat;
    use tunnelstitch_geometry::surface::Circle;

    #[test]
    fn a_long_panorama_becomes_short_and_keeps_its_places() {
        let canvas = Canvas {
            columns: 1000,
            rows: 9000,
            px_per_metre: 100.0,
            h_start_m: -3.0,
        };
        let mut preview = Preview::new(&canvas);
        let format = PixelFormat {
            channels: 1,
            deep: false,
        };
        // Bright at 90 m less 3, from 270° on.
        for row in (0..9000).step_by(500) {
            let mut band = Band::empty(&canvas, format, false);
            band.begin(&canvas, row, 500);
            let samples = (0..500 * 1000).flat_map(|k| {
                let bright = row == 8500 && k % 1000 >= 750;
                [if bright { 240 } else { 10 }, 255]
            });
            band.samples = Samples::Eight(samples.collect());
            preview.put(&canvas, &band).unwrap();
        }
        for layout in [Layout::ThetaRight, Layout::ChainageRight] {
            let picture = preview.picture(&Circle::new(1000.0 / 100.0 / TAU).unwrap(), layout, 0.0);
            assert!(picture.width().max(picture.height()) <= MAX_SIDE_PX);
            let at = |share_around: f64, share_along: f64| {
                let [x, y] = match layout {
                    Layout::ThetaRight => [share_around, share_along],
                    Layout::ChainageRight => [share_along, 1.0 - share_around],
                };
                let inner = |share: f64, side: u32| {
                    MARGIN_PX + (share * f64::from(side - 2 * MARGIN_PX)) as u32
                };
                picture
                    .get_pixel(inner(x, picture.width()), inner(y, picture.height()))
                    .0
            };
            assert_eq!(at(0.9, 0.98), [240; 3]);
            assert_eq!(at(0.6, 0.98), [10; 3]);
            assert_eq!(at(0.9, 0.5), [10; 3]);
        }
        let chainages = preview.chainages();
        assert_eq!(chainages[0], (0.0, "0 m".to_owned()));
        assert!(chainages.len() > 5 && chainages.len() < 30, "{chainages:?}");
    }
}
