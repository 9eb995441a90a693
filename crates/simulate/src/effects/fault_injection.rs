//! Fault injection: the images of bad frames.

use crate::bad_frames::{BadFrames, FrameFault};
use crate::effects::frame_effect::FrameEffect;
use crate::procedural_noise::{RandomStream, ValueNoise, derived_seed};
use rand::Rng;
use std::f64::consts::PI;
use tunnelstitch_core::frames::GreyImage;

/// Range of the motion blur's length, pixels.
const BLUR_PX: [f64; 2] = [15.0, 30.0];
/// Grey level of the occluding object.
const OBJECT_GREY: f32 = 25.0;
/// Texture of the object: amplitude (grey levels) and cell size (pixels) of each octave.
const OBJECT_TEXTURE: [(f32, f64); 2] = [(10.0, 24.0), (8.0, 5.0)];

/// Faults of the frames of a survey.
pub(super) struct InjectedFaults {
    /// The frames with a fault.
    pub bad_frames: BadFrames,
    /// Seed of the survey.
    pub seed: u64,
}

impl FrameEffect for InjectedFaults {
    fn apply(&self, frame: usize, image: GreyImage) -> GreyImage {
        match self.bad_frames.fault(frame) {
            Some(fault) => inject_fault(fault, self.seed, frame, image),
            None => image,
        }
    }
}

/// Applies a fault to the noise-free image of a frame.
///
/// A repeated or missing frame has no image of its own, so its image stays unchanged.
fn inject_fault(fault: FrameFault, seed: u64, frame: usize, image: GreyImage) -> GreyImage {
    let mut rng = RandomStream::BadFrames.rng(seed, frame);
    let (width, height) = (image.width(), image.height());
    match fault {
        FrameFault::Black => GreyImage::new(width, height, vec![0.0; width * height]),
        FrameFault::Blurred => {
            let length_px = rng.random_range(BLUR_PX[0]..BLUR_PX[1]);
            blur_by_motion(&image, length_px, rng.random_range(0.0..PI))
        }
        FrameFault::Occluded => occlude(image, rng.random()),
        FrameFault::Repeated | FrameFault::Missing => image,
    }
}

/// Averages along a line of `length_px` pixels through every pixel, at `angle` (radians) from u
/// towards v; the border repeats the outermost pixels.
fn blur_by_motion(image: &GreyImage, length_px: f64, angle: f64) -> GreyImage {
    let (width, height) = (image.width(), image.height());
    let (sin, cos) = angle.sin_cos();
    // Two samples per pixel.
    let steps = (2.0 * length_px).ceil() as usize;
    let offsets: Vec<[f64; 2]> = (0..steps)
        .map(|k| ((k as f64 + 0.5) / steps as f64 - 0.5) * length_px)
        .map(|offset| [offset * cos, offset * sin])
        .collect();
    let mut data = Vec::with_capacity(width * height);
    for v in 0..height {
        for u in 0..width {
            let sum: f32 = offsets
                .iter()
                .map(|[du, dv]| sample_bilinear(image, u as f64 + du, v as f64 + dv))
                .sum();
            data.push(sum / steps as f32);
        }
    }
    GreyImage::new(width, height, data)
}

/// Interpolates bilinearly at (u, v), pixels.
fn sample_bilinear(image: &GreyImage, u: f64, v: f64) -> f32 {
    let cell = |x: f64, size: usize| {
        let x = x.clamp(0.0, (size - 1) as f64);
        let first = (x as usize).min(size - 2);
        (first, (x - first as f64) as f32)
    };
    let (u, fu) = cell(u, image.width());
    let (v, fv) = cell(v, image.height());
    let across = |v: usize| {
        let (a, b) = (image.at(u, v), image.at(u + 1, v));
        a + (b - a) * fu
    };
    let (a, b) = (across(v), across(v + 1));
    a + (b - a) * fv
}

/// Covers the left half with a dark textured object.
fn occlude(image: GreyImage, seed: u64) -> GreyImage {
    let (width, height) = (image.width(), image.height());
    let half = width / 2;
    let mut data = image.data().to_vec();
    for (v, row) in data.chunks_exact_mut(width).enumerate() {
        let object = &mut row[..half];
        object.fill(OBJECT_GREY);
        for (purpose, (amplitude, size_px)) in (1..).zip(OBJECT_TEXTURE) {
            let seed = derived_seed(seed, purpose);
            // In units of pixels instead of metres.
            let texture = ValueNoise::unique(seed, amplitude, size_px, half as f64);
            texture.add_to_row(v as f64, 1.0, object);
        }
    }
    GreyImage::new(width, height, data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge() -> GreyImage {
        let data = (0..120 * 90).map(|k| if k % 120 < 80 { 60.0 } else { 160.0 });
        GreyImage::new(120, 90, data.collect())
    }

    #[test]
    fn a_black_frame_is_black() {
        let black = inject_fault(FrameFault::Black, 1, 4, edge());
        assert!(black.data().iter().all(|v| *v == 0.0));
    }

    #[test]
    fn an_edge_blurs_over_the_length_of_the_motion() {
        let (length_px, angle) = (20.0, 0.6f64);
        let blurred = blur_by_motion(&edge(), length_px, angle);
        let row: Vec<f32> = (0..120).map(|u| blurred.at(u, 45)).collect();
        // From 5 % to 95 % of the step lie 90 % of the motion across it.
        let part = row.iter().filter(|v| (65.0..155.0).contains(*v)).count() as f64;
        assert!(
            (part - 0.9 * length_px * angle.cos()).abs() <= 1.5,
            "{part}"
        );
        assert!((row[10] - 60.0).abs() < 1e-3 && (row[110] - 160.0).abs() < 1e-3);
        assert_ne!(
            inject_fault(FrameFault::Blurred, 1, 4, edge()),
            inject_fault(FrameFault::Blurred, 1, 5, edge())
        );
    }

    #[test]
    fn an_occluded_frame_keeps_its_right_half() {
        let frame = inject_fault(FrameFault::Occluded, 1, 4, edge());
        let (mut low, mut high) = (f32::MAX, f32::MIN);
        for v in 0..90 {
            for u in 0..120 {
                let value = frame.at(u, v);
                if u >= 60 {
                    assert_eq!(value, edge().at(u, v));
                } else {
                    (low, high) = (low.min(value), high.max(value));
                }
            }
        }
        assert!(
            low > 0.0 && high < 50.0 && high - low > 15.0,
            "{low} {high}"
        );
    }
}
