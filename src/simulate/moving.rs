//! Things between camera and wall.

use super::noise::Purpose;
use crate::frames::GreyImage;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Size of a thing, from and to, shares of the frame's height.
const SIZE: [f64; 2] = [0.02, 0.10];
/// Grey levels of dark and of bright things.
const TONES: [f32; 2] = [15.0, 240.0];
/// Share of the wall that a thing hides, from and to: a shadow lets some of it through.
const OPACITY: [f32; 2] = [0.6, 1.0];
/// Width of a line, shares of its length.
const LINE_WIDTH: f64 = 0.08;

/// A drop, an insect, the shadow of a cable: an ellipse or a line, dark or bright.
#[derive(Clone, Debug)]
struct Thing {
    /// Centre (u, v), pixels.
    centre: [f64; 2],
    /// Sine and cosine of the angle from u to its long axis.
    turn: (f64, f64),
    shape: Shape,
    tone: f32,
    opacity: f32,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Half the diameters, pixels, the longer first.
    Ellipse([f64; 2]),
    /// Half the length without the round ends, and half the width, pixels.
    Line([f64; 2]),
}

impl Thing {
    /// A thing somewhere in a frame of `width × height` pixels.
    fn draw(rng: &mut ChaCha8Rng, width: usize, height: usize) -> Self {
        let half = 0.5 * rng.random_range(SIZE[0]..SIZE[1]) * height as f64;
        let shape = if rng.random::<bool>() {
            Shape::Ellipse([half, half * rng.random_range(0.4..1.0)])
        } else {
            let half_width = (LINE_WIDTH * half).max(0.5);
            Shape::Line([(half - half_width).max(0.0), half_width])
        };
        Self {
            centre: [width, height].map(|size| rng.random_range(-0.5..size as f64 - 0.5)),
            turn: rng.random_range(0.0..PI).sin_cos(),
            shape,
            tone: TONES[usize::from(rng.random::<bool>())],
            opacity: rng.random_range(OPACITY[0]..OPACITY[1]),
        }
    }

    /// Share of a pixel that the thing covers: its edge is a pixel wide.
    fn cover(&self, u: f64, v: f64) -> f64 {
        let (du, dv) = (u - self.centre[0], v - self.centre[1]);
        let (sin, cos) = self.turn;
        let (x, y) = (cos * du + sin * dv, cos * dv - sin * du);
        // Pixels to the edge, exact for a line and on an ellipse's shorter axis.
        let inside = match self.shape {
            Shape::Ellipse([a, b]) => b * (1.0 - (x / a).hypot(y / b)),
            Shape::Line([half, half_width]) => half_width - (x.abs() - half).max(0.0).hypot(y),
        };
        (0.5 + inside).clamp(0.0, 1.0)
    }

    /// Farthest that it reaches from its centre, pixels.
    fn reach(&self) -> f64 {
        let half = match self.shape {
            Shape::Ellipse([a, _]) => a,
            Shape::Line([half, half_width]) => half + half_width,
        };
        // The edge: half a pixel, up to 2.5 times that along an ellipse's longer axis.
        half + 1.5
    }

    /// Hides the wall: `L ← L + o c (T − L)` with opacity o, cover c and tone T.
    fn hide(&self, width: usize, height: usize, light: &mut [f32]) {
        let reach = self.reach();
        let pixels = |k: usize, size: usize| {
            let from = (self.centre[k] - reach).max(0.0) as usize;
            let to = (self.centre[k] + reach).max(0.0) as usize + 1;
            from..to.min(size)
        };
        for v in pixels(1, height) {
            for u in pixels(0, width) {
                let cover = self.opacity * self.cover(u as f64, v as f64) as f32;
                let pixel = &mut light[v * width + u];
                *pixel += cover * (self.tone - *pixel);
            }
        }
    }
}

/// Puts `count` things into a frame, each anywhere, at other places in every frame.
pub(super) fn hide_behind_things(
    seed: u64,
    frame: usize,
    count: u32,
    picture: GreyImage,
) -> GreyImage {
    let (width, height) = (picture.width(), picture.height());
    let mut rng = Purpose::Moving.rng(seed, frame);
    let mut light = picture.data().to_vec();
    for _ in 0..count {
        Thing::draw(&mut rng, width, height).hide(width, height, &mut light);
    }
    GreyImage::new(width, height, light)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 200;

    fn frame(frame: usize, count: u32) -> GreyImage {
        let wall = GreyImage::new(SIDE, SIDE, vec![128.0; SIDE * SIDE]);
        hide_behind_things(9, frame, count, wall)
    }

    #[test]
    fn a_thing_is_small_and_elsewhere_in_every_frame() {
        let mut centres = Vec::new();
        let (mut dark, mut bright) = (0, 0);
        for k in 0..60 {
            let picture = frame(k, 1);
            let hidden: Vec<usize> = (0..SIDE * SIDE)
                .filter(|k| (picture.data()[*k] - 128.0).abs() > 20.0)
                .collect();
            assert!(!hidden.is_empty(), "frame {k}");
            let extent = |coordinate: fn(usize) -> usize| {
                let all = hidden.iter().map(|k| coordinate(*k));
                (all.clone().min().unwrap(), all.max().unwrap())
            };
            let (left, right) = extent(|k| k % SIDE);
            let (top, bottom) = extent(|k| k / SIDE);
            // A tenth of the height, and the edge.
            assert!(right - left <= 22 && bottom - top <= 22, "frame {k}");
            centres.push((left + right, top + bottom));
            if picture.data()[hidden[hidden.len() / 2]] < 128.0 {
                dark += 1
            } else {
                bright += 1
            }
        }
        assert!(dark > 10 && bright > 10, "{dark} {bright}");
        centres.sort_unstable();
        centres.dedup();
        assert!(centres.len() > 55);
    }

    #[test]
    fn more_things_hide_more_and_none_nothing() {
        let hidden = |count| {
            let picture = frame(3, count);
            picture.data().iter().filter(|v| **v != 128.0).count()
        };
        assert_eq!(hidden(0), 0);
        assert!(hidden(10) > 3 * hidden(1) / 2 && hidden(10) < SIDE * SIDE / 5);
        assert_eq!(frame(3, 10), frame(3, 10));
    }
}
