//! Shaft of the camera rig: an occluder at the same pixels of every frame.

use crate::effects::frame_effect::FrameEffect;
use std::f64::consts::TAU;
use tunnelstitch_core::frames::GreyImage;

/// Column of the shaft's axis at the frame's lower edge, as a share of the width.
const FOOT: f64 = 0.42;
/// Column and row of the shaft's tip, as shares of the width and height.
const TIP: [f64; 2] = [0.36, 0.25];
/// Grey level of the shaft's edge and the difference of its middle: a round bar, lit from the
/// camera.
const TONES: [f32; 2] = [18.0, 30.0];
/// Rings along the shaft: maximum added grey levels, and period as a share of the width.
const RINGS: (f32, f64) = (14.0, 0.45);

/// Dark round bar with rings that occludes the wall at the same pixels of every frame.
pub(crate) struct RigShaft {
    width: usize,
    height: usize,
    /// Half the width of the shaft, pixels.
    half_px: f64,
}

impl RigShaft {
    /// The shaft in frames of `width × height` pixels, `percent` of them wide.
    pub fn new(percent: f64, width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            half_px: 0.005 * percent * width as f64,
        }
    }

    /// Distance of a pixel from the axis, −1 at one edge to 1 at the other; `None` beside it.
    fn across(&self, u: usize, v: usize) -> Option<f64> {
        let (width, height) = (self.width as f64, self.height as f64);
        let up = 1.0 - v as f64 / height;
        let axis = width * (FOOT + (TIP[0] - FOOT) * up);
        let across = (u as f64 - axis) / self.half_px;
        (up <= 1.0 - TIP[1] && across.abs() <= 1.0).then_some(across)
    }

    /// Mask of the pixels that show the wall, row-major.
    pub fn wall_mask(&self) -> Vec<bool> {
        (0..self.width * self.height)
            .map(|k| self.across(k % self.width, k / self.width).is_none())
            .collect()
    }
}

impl FrameEffect for RigShaft {
    fn apply(&self, _frame: usize, mut image: GreyImage) -> GreyImage {
        for (k, value) in image.data_mut().iter_mut().enumerate() {
            let (u, v) = (k % self.width, k / self.width);
            if let Some(across) = self.across(u, v) {
                let round = (1.0 - across * across).sqrt() as f32;
                let ring = (TAU * v as f64 / (RINGS.1 * 2.0 * self.half_px)).sin() as f32;
                *value = TONES[0] + TONES[1] * round + RINGS.0 * ring.max(0.0);
            }
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mask_is_what_the_shaft_hides() {
        let shaft = RigShaft::new(12.0, 160, 120);
        let wall = shaft.wall_mask();
        let frame = shaft.apply(0, GreyImage::new(160, 120, vec![150.0; 160 * 120]));
        let hidden = wall.iter().filter(|wall| !**wall).count() as f64 / wall.len() as f64;
        assert!((hidden - 0.12 * 0.75).abs() < 0.01, "{hidden}");
        for (value, wall) in frame.data().iter().zip(&wall) {
            assert!(if *wall {
                *value == 150.0
            } else {
                (10.0..80.0).contains(value)
            });
        }
    }
}
