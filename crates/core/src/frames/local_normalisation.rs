//! Local normalisation of a frame: what is left of it when light is taken off.
//!
//! A frame shows `I = V W` of the wall W in the light V. Light is smooth: where it varies more than
//! exposures and a shading fixed to the camera describe (a lamp whose distance to the wall changes,
//! its sheen, mains flicker from row to row, an unknown tone curve, the fall of light along the
//! tunnel), detail finer than it is still the wall's. With local means taken over a window,
//!
//! `N = 128 + 40 (D − D̄)/(√(mean (D − D̄)²) + κ σ)`,   `D = I − Ī`,
//!
//! σ the noise of the frame: contrast relative to that of its surroundings, which the light has
//! scaled alike, or to the noise where there is no more than that.
//!
//! The window of `Ī` is nine times as wide as high: rows are read one after another, and flicker
//! varies with the row only. What it leaves of a light that varies along the rows, a sheen of its
//! width, `D̄` takes off, the mean over the square window of the spread.

use super::grey::GreyImage;
use super::noise::noise_sigma;
use super::windows::{window_means, window_moments};

/// Half height of the window of the mean over the frame's shorter side: a standard deviation of a
/// 72nd, for two passes.
const MEAN_HALF_HEIGHT: f64 = 1.0 / 60.0;
/// Width of that window over its height.
const MEAN_ASPECT: f64 = 9.0;
/// Half side of the window of the spread over the frame's shorter side.
const SPREAD_HALF_SIDE: f64 = 1.0 / 12.0;
/// Mean of a normalised frame, grey levels.
const MIDDLE_GREY: f32 = 128.0;
/// Spread of a normalised frame where there is no noise, grey levels.
const SPREAD_GREY: f32 = 40.0;
/// Multiple κ of the noise that is added to the spread.
const NOISE_WEIGHT: f32 = 4.0;
/// Noise of a frame at the least, grey levels: that of rounding to whole levels.
const MIN_NOISE_GREY: f32 = 0.3;
/// Grey level from which on a pixel is clipped, and shows nothing but that.
const CLIPPED_GREY: f32 = 252.0;
/// Share of clipped pixels in the window of the mean from which on that is not known.
const MAX_CLIPPED_SHARE: f32 = 0.05;

/// Normalises a frame locally. Pixels without a value have none (NaN), and neither have those of
/// whose surroundings much is clipped, where the mean is not known.
pub fn normalise_locally(image: &GreyImage) -> GreyImage {
    let (width, height) = (image.width(), image.height());
    let is_clipped = |value: &f32| *value >= CLIPPED_GREY;
    let known = image.data().iter();
    let known = known.map(|value| if is_clipped(value) { f32::NAN } else { *value });
    let known: Vec<f32> = known.collect();
    let clipped = image.data().iter().map(is_clipped);
    let clipped: Vec<f32> = clipped
        .map(|clipped| f32::from(u8::from(clipped)))
        .collect();
    let reach = |share: f64| ((share * width.min(height) as f64).round() as usize).max(1);
    let half_height = reach(MEAN_HALF_HEIGHT);
    let mean_window = [(MEAN_ASPECT * half_height as f64) as usize, half_height];
    let half_side = reach(SPREAD_HALF_SIDE);
    let means = |values: &[f32], window| window_means(values, width, window);
    let mean = means(&means(&known, mean_window), mean_window);
    let detail: Vec<f32> = known.iter().zip(&mean).map(|(v, m)| v - m).collect();
    let moments = window_moments(&detail, width, [half_side; 2]);
    let noise = noise_sigma(image).map_or(MIN_NOISE_GREY, |sigma| sigma as f32);
    let floor = NOISE_WEIGHT * noise.max(MIN_NOISE_GREY);
    let clipped = means(&clipped, mean_window);
    let normalised = detail.iter().zip(moments.iter().zip(&clipped));
    let normalised = normalised.map(|(d, (of, clipped))| {
        if *clipped < MAX_CLIPPED_SHARE {
            MIDDLE_GREY + SPREAD_GREY * (d - of.mean) / (of.variance.max(0.0).sqrt() + floor)
        } else {
            f32::NAN
        }
    });
    GreyImage::new(width, height, normalised.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (160, 120);

    /// Fine texture in a light.
    fn picture(light: impl Fn(f32, f32) -> f32) -> GreyImage {
        let (w, h) = SIZE;
        let value = |k: usize| {
            let (x, y) = ((k % w) as f32, (k / w) as f32);
            let texture = 1.0 + 0.1 * (0.8 * x).sin() * (0.6 * y).cos();
            80.0 * texture * light(x / w as f32, y / h as f32)
        };
        GreyImage::new(w, h, (0..w * h).map(value).collect())
    }

    fn rms_difference(a: &GreyImage, b: &GreyImage) -> f32 {
        let inside = |k: &usize| {
            let (x, y) = (k % SIZE.0, k / SIZE.0);
            (20..SIZE.0 - 20).contains(&x) && (15..SIZE.1 - 15).contains(&y)
        };
        let squares = (0..a.data().len()).filter(inside);
        let squares: Vec<f32> = squares
            .map(|k| (a.data()[k] - b.data()[k]).powi(2))
            .collect();
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    }

    #[test]
    fn smooth_light_and_flicker_leave_the_texture_as_it_is() {
        let even = normalise_locally(&picture(|_, _| 1.0));
        let spread = rms_difference(
            &even,
            &GreyImage::new(SIZE.0, SIZE.1, vec![128.0; 160 * 120]),
        );
        assert!(spread > 10.0, "{spread}");
        let lamp = |u: f32, v: f32| 1.5 / (1.0 + (u - 0.6).powi(2) + (v - 0.4).powi(2));
        let lit = normalise_locally(&picture(lamp));
        let left = rms_difference(&even, &lit);
        assert!(left < 0.2 * spread, "{left} {spread}");
        let flicker = |_: f32, v: f32| 1.0 + 0.25 * (std::f32::consts::TAU * 3.0 * v).sin();
        let flickering = normalise_locally(&picture(flicker));
        let left = rms_difference(&even, &flickering);
        assert!(left < 0.2 * spread, "{left} {spread}");
    }

    /// A sheen is no wider than the window of the mean, which the rows of flicker make long.
    #[test]
    fn a_sheen_leaves_the_texture_as_it_is() {
        let even = normalise_locally(&picture(|_, _| 1.0));
        let spread = rms_difference(
            &even,
            &GreyImage::new(SIZE.0, SIZE.1, vec![128.0; 160 * 120]),
        );
        let mut shining = picture(|_, _| 1.0);
        for (k, value) in shining.data_mut().iter_mut().enumerate() {
            let (x, y) = ((k % SIZE.0) as f32, (k / SIZE.0) as f32);
            *value += 75.0 * (-((x - 85.0).powi(2) + (y - 55.0).powi(2)) / (2.0 * 400.0)).exp();
        }
        let left = rms_difference(&even, &normalise_locally(&shining));
        assert!(left < 0.3 * spread, "{left} {spread}");
    }

    /// A pixel whose surroundings are clipped in part has a value that these do not distort; among
    /// clipped ones there is none.
    #[test]
    fn clipped_pixels_have_no_value_and_no_influence() {
        let plain = picture(|_, _| 1.0);
        let mut hurt = plain.clone();
        for (k, value) in hurt.data_mut().iter_mut().enumerate() {
            let (x, y) = (k % SIZE.0, k / SIZE.0);
            if (70..90).contains(&x) && (50..70).contains(&y) {
                *value = 255.0;
            }
        }
        let (a, b) = (normalise_locally(&plain), normalise_locally(&hurt));
        let mut known = 0;
        for (k, (a, b)) in a.data().iter().zip(b.data()).enumerate() {
            let (x, y) = (k % SIZE.0, k / SIZE.0);
            if (70..90).contains(&x) && (50..70).contains(&y) {
                assert!(b.is_nan());
            } else if !b.is_nan() {
                known += 1;
                assert!((a - b).abs() < 8.0, "{x} {y}: {a} {b}");
            }
        }
        assert!(known > SIZE.0 * SIZE.1 * 3 / 4, "{known}");
    }
}
