//! Tone curve of the sensor.

use crate::effects::frame_effect::FrameEffect;
use tunnelstitch_core::frames::GreyImage;

/// Transfer function of a camera with exponent G, `y = 255 (x/255)^(1/G)`, for x of 0 to 255;
/// values outside saturate first.
#[derive(Clone, Copy, Debug)]
pub(super) struct ToneCurve {
    gamma: f32,
}

impl ToneCurve {
    /// The curve of exponent `gamma` (G); 1 for a linear sensor.
    pub fn new(gamma: f64) -> Self {
        Self {
            gamma: gamma as f32,
        }
    }

    /// Output for the linear grey level x.
    pub fn at(&self, x: f32) -> f32 {
        255.0 * (x / 255.0).clamp(0.0, 1.0).powf(1.0 / self.gamma)
    }
}

impl FrameEffect for ToneCurve {
    fn apply(&self, _frame: usize, mut image: GreyImage) -> GreyImage {
        for value in image.data_mut() {
            *value = self.at(*value);
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_keeps_its_ends_and_inverts_to_linear_light() {
        let levels = vec![-20.0, 0.0, 20.0, 127.5, 255.0, 400.0];
        let curved = ToneCurve::new(2.2).apply(0, GreyImage::new(6, 1, levels.clone()));
        assert_eq!(curved.at(0, 0), 0.0);
        assert_eq!((curved.at(1, 0), curved.at(4, 0)), (0.0, 255.0));
        assert_eq!(curved.at(5, 0), 255.0);
        for (k, level) in [(2, levels[2]), (3, levels[3])] {
            let linear = 255.0 * (curved.at(k, 0) / 255.0).powf(2.2);
            assert!((linear - level).abs() < 1e-3, "{linear}");
            assert!(curved.at(k, 0) > level + 40.0);
        }
        // A gamma below 1 darkens.
        assert!(ToneCurve::new(0.5).at(100.0) < 50.0);
    }
}
