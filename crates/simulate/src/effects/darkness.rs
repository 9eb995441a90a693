//! Little light.

use crate::effects::frame_effect::FrameEffect;
use crate::effects::tone_curve::ToneCurve;
use tunnelstitch_core::frames::GreyImage;

/// Mean grey level of a dark survey.
const MEAN_GREY: f64 = 12.0;

/// Light that is dimmed by one factor in all frames; the sensor's noise stays as it is.
pub(super) struct Darkness {
    factor: f32,
}

impl Darkness {
    /// Light dimmed by `factor`.
    pub fn new(factor: f64) -> Self {
        Self {
            factor: factor as f32,
        }
    }
}

impl FrameEffect for Darkness {
    fn apply(&self, _frame: usize, mut image: GreyImage) -> GreyImage {
        for value in image.data_mut() {
            *value *= self.factor;
        }
        image
    }
}

/// Factor f by which light is to be dimmed so that the pictures have the mean grey level 12.
///
/// With T the tone curve of exponent `gamma` (G), `T(f x) = f^(1/G) T(x)`, so that
/// `f = (12 / mean T(x))^G`. Frames without light give 1.
pub(crate) fn dimming_factor(light: &[GreyImage], gamma: f64) -> f64 {
    let curve = ToneCurve::new(gamma);
    let values = || light.iter().flat_map(|image| image.data());
    let sum: f64 = values().map(|value| f64::from(curve.at(*value))).sum();
    if sum > 0.0 {
        (MEAN_GREY * values().count() as f64 / sum).powf(gamma)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dimmed_pictures_have_the_mean_after_the_tone_curve() {
        let data: Vec<f32> = (0..400).map(|k| 20.0 + 0.4 * k as f32).collect();
        let image = GreyImage::new(20, 20, data);
        for gamma in [1.0, 2.2] {
            let factor = dimming_factor(&[image.clone(), image.clone()], gamma);
            let dark = Darkness::new(factor).apply(0, image.clone());
            let dark = ToneCurve::new(gamma).apply(0, dark);
            let mean = dark.data().iter().sum::<f32>() / 400.0;
            assert!((mean - 12.0).abs() < 1e-3, "{mean}");
        }
        let black = GreyImage::new(2, 2, vec![0.0; 4]);
        assert_eq!(dimming_factor(&[black], 2.2), 1.0);
    }
}
