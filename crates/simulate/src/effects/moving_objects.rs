//! Moving objects between camera and wall: outliers at random positions in every frame.

use crate::effects::frame_effect::FrameEffect;
use crate::procedural_noise::RandomStream;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;
use tunnelstitch_core::frames::GreyImage;

/// Range of an object's size, shares of the frame's height.
const SIZE: [f64; 2] = [0.02, 0.10];
/// Grey levels of dark and of bright objects.
const TONES: [f32; 2] = [15.0, 240.0];
/// Range of the opacity: a shadow lets some of the wall through.
const OPACITY: [f32; 2] = [0.6, 1.0];
/// Width of a line, as a share of its length.
const LINE_WIDTH: f64 = 0.08;

/// Ellipse or line, dark or bright, as a drop, an insect or the shadow of a cable.
#[derive(Clone, Debug)]
struct MovingObject {
    /// Centre (u, v), pixels.
    centre: [f64; 2],
    /// Sine and cosine of the angle from u to its long axis.
    turn: (f64, f64),
    shape: ObjectShape,
    tone: f32,
    opacity: f32,
}

#[derive(Clone, Copy, Debug)]
enum ObjectShape {
    /// Semi-axes, pixels, the longer first.
    Ellipse([f64; 2]),
    /// Half the length without the round ends, and half the width, pixels.
    RayRow([f64; 2]),
}

impl MovingObject {
    /// Draws a random object in a frame of `width × height` pixels.
    fn random(rng: &mut ChaCha8Rng, width: usize, height: usize) -> Self {
        let half = 0.5 * rng.random_range(SIZE[0]..SIZE[1]) * height as f64;
        let shape = if rng.random::<bool>() {
            ObjectShape::Ellipse([half, half * rng.random_range(0.4..1.0)])
        } else {
            let half_width = (LINE_WIDTH * half).max(0.5);
            ObjectShape::RayRow([(half - half_width).max(0.0), half_width])
        };
        Self {
            centre: [width, height].map(|size| rng.random_range(-0.5..size as f64 - 0.5)),
            turn: rng.random_range(0.0..PI).sin_cos(),
            shape,
            tone: TONES[usize::from(rng.random::<bool>())],
            opacity: rng.random_range(OPACITY[0]..OPACITY[1]),
        }
    }

    /// Share of a pixel that the object covers; its edge is one pixel wide.
    fn coverage(&self, u: f64, v: f64) -> f64 {
        let (du, dv) = (u - self.centre[0], v - self.centre[1]);
        let (sin, cos) = self.turn;
        let (x, y) = (cos * du + sin * dv, cos * dv - sin * du);
        // Distance to the edge, pixels: exact for a line and on the minor axis of an ellipse.
        let inside = match self.shape {
            ObjectShape::Ellipse([a, b]) => b * (1.0 - (x / a).hypot(y / b)),
            ObjectShape::RayRow([half, half_width]) => {
                half_width - (x.abs() - half).max(0.0).hypot(y)
            }
        };
        (0.5 + inside).clamp(0.0, 1.0)
    }

    /// Maximum distance of a covered pixel from the centre, pixels.
    fn radius_px(&self) -> f64 {
        let half = match self.shape {
            ObjectShape::Ellipse([a, _]) => a,
            ObjectShape::RayRow([half, half_width]) => half + half_width,
        };
        // The soft edge adds half a pixel, up to 2.5 times that along the major axis.
        half + 1.5
    }

    /// Blends the object over the wall: `L ← L + o c (T − L)`, opacity o, coverage c, tone T.
    fn blend(&self, width: usize, height: usize, light: &mut [f32]) {
        let radius_px = self.radius_px();
        let pixels = |k: usize, size: usize| {
            let from = (self.centre[k] - radius_px).max(0.0) as usize;
            let to = (self.centre[k] + radius_px).max(0.0) as usize + 1;
            from..to.min(size)
        };
        for v in pixels(1, height) {
            for u in pixels(0, width) {
                let alpha = self.opacity * self.coverage(u as f64, v as f64) as f32;
                let pixel = &mut light[v * width + u];
                *pixel += alpha * (self.tone - *pixel);
            }
        }
    }
}

/// Moving objects in every frame.
pub(super) struct MovingObjects {
    /// Seed of the survey.
    pub seed: u64,
    /// Number of objects in each frame.
    pub count: u32,
}

impl FrameEffect for MovingObjects {
    fn apply(&self, frame: usize, image: GreyImage) -> GreyImage {
        draw_moving_objects(self.seed, frame, self.count, image)
    }
}

/// Draws `count` objects into a frame, at independent random positions in every frame.
fn draw_moving_objects(seed: u64, frame: usize, count: u32, image: GreyImage) -> GreyImage {
    let (width, height) = (image.width(), image.height());
    let mut rng = RandomStream::MovingObjects.rng(seed, frame);
    let mut light = image.data().to_vec();
    for _ in 0..count {
        MovingObject::random(&mut rng, width, height).blend(width, height, &mut light);
    }
    GreyImage::new(width, height, light)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 200;

    fn frame(frame: usize, count: u32) -> GreyImage {
        let wall = GreyImage::new(SIDE, SIDE, vec![128.0; SIDE * SIDE]);
        draw_moving_objects(9, frame, count, wall)
    }

    #[test]
    fn an_object_is_small_and_elsewhere_in_every_frame() {
        let mut centres = Vec::new();
        let (mut dark, mut bright) = (0, 0);
        for k in 0..60 {
            let image = frame(k, 1);
            let hidden: Vec<usize> = (0..SIDE * SIDE)
                .filter(|k| (image.data()[*k] - 128.0).abs() > 20.0)
                .collect();
            assert!(!hidden.is_empty(), "frame {k}");
            let extent = |coordinate: fn(usize) -> usize| {
                let all = hidden.iter().map(|k| coordinate(*k));
                (all.clone().min().unwrap(), all.max().unwrap())
            };
            let (left, right) = extent(|k| k % SIDE);
            let (top, bottom) = extent(|k| k / SIDE);
            // A tenth of the height, plus the soft edge.
            assert!(right - left <= 22 && bottom - top <= 22, "frame {k}");
            centres.push((left + right, top + bottom));
            if image.data()[hidden[hidden.len() / 2]] < 128.0 {
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
    fn more_objects_cover_more_and_none_nothing() {
        let hidden = |count| {
            let image = frame(3, count);
            image.data().iter().filter(|v| **v != 128.0).count()
        };
        assert_eq!(hidden(0), 0);
        assert!(hidden(10) > 3 * hidden(1) / 2 && hidden(10) < SIDE * SIDE / 5);
        assert_eq!(frame(3, 10), frame(3, 10));
    }
}
