//! Flicker of lamps on the mains under a rolling exposure.

use crate::effects::frame_effect::FrameEffect;
use crate::error::{SimulateError, check_option};
use crate::procedural_noise::RandomStream;
use rand::Rng;
use serde::Serialize;
use std::f64::consts::TAU;
use tunnelstitch_core::frames::GreyImage;

/// Flicker that shows as horizontal bands, since rows are exposed one after the other.
///
/// Row v of H has the light `1 + P/100 sin(2π N v/H + φ)`, with an independent uniform phase φ in
/// each frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Flicker {
    /// Amplitude P, percent of the mean light.
    #[serde(rename = "flicker_percent")]
    pub percent: f64,
    /// Number N of bands over the height of a frame.
    #[serde(rename = "flicker_bands")]
    pub bands: f64,
}

impl Flicker {
    /// Validates amplitude and number of bands.
    ///
    /// # Errors
    /// [`SimulateError::Option`].
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        check_option(
            (0.0..=100.0).contains(&self.percent),
            "the flicker must be 0 to 100 percent of the light",
        )?;
        check_option(
            self.bands > 0.0 && self.bands <= 1000.0,
            "the number of flicker bands must lie above 0 and up to 1000",
        )
    }
}

/// Flicker with the random phases of a survey.
pub(super) struct FlickeringLight {
    flicker: Flicker,
    seed: u64,
}

impl FlickeringLight {
    /// Flicker with phases by the survey's seed.
    pub fn new(flicker: Flicker, seed: u64) -> Self {
        Self { flicker, seed }
    }
}

impl FrameEffect for FlickeringLight {
    fn apply(&self, frame: usize, mut image: GreyImage) -> GreyImage {
        let (width, height) = (image.width(), image.height() as f64);
        let mut rng = RandomStream::Flicker.rng(self.seed, frame);
        let phase = rng.random_range(0.0..TAU);
        let Flicker { percent, bands } = self.flicker;
        for (v, row) in image.data_mut().chunks_exact_mut(width).enumerate() {
            let turn = TAU * bands * v as f64 / height + phase;
            let light = (1.0 + percent / 100.0 * turn.sin()) as f32;
            row.iter_mut().for_each(|value| *value *= light);
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The discrete Fourier transform along the rows has the amplitude at N bands and nothing
    /// elsewhere; phases differ from frame to frame.
    #[test]
    fn rows_flicker_at_one_frequency_with_a_phase_of_their_own() {
        let (percent, bands, height) = (12.0, 3.0, 240);
        let light = FlickeringLight::new(Flicker { percent, bands }, 5);
        let mut phases = Vec::new();
        for frame in 0..8 {
            let image = light.apply(frame, GreyImage::new(2, height, vec![100.0; 2 * height]));
            let spectrum = |n: f64| {
                let parts = (0..height).map(|v| {
                    let (sin, cos) = (TAU * n * v as f64 / height as f64).sin_cos();
                    let value = f64::from(image.at(1, v)) / 100.0 - 1.0;
                    (value * sin, value * cos)
                });
                let (sin, cos) =
                    parts.fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
                (2.0 / height as f64 * sin.hypot(cos), cos.atan2(sin))
            };
            assert!((spectrum(bands).0 - 0.12).abs() < 1e-5);
            assert!(spectrum(2.0).0 < 1e-5 && spectrum(4.0).0 < 1e-5);
            assert_eq!(image.at(0, 77), image.at(1, 77));
            phases.push(spectrum(bands).1);
        }
        phases.sort_by(f64::total_cmp);
        assert!(phases[7] - phases[0] > 1.0, "{phases:?}");
    }
}
