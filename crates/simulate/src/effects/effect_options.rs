//! Options of the effects on frames.

use crate::effects::flicker::Flicker;
use crate::effects::sensor::BitDepth;
use crate::error::{SimulateError, check_option};
use serde::Serialize;

/// Parts of a burnt-in overlay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum OverlayParts {
    /// Lines of text, the last with date, time and a counter.
    Text,
    /// A logo.
    Logo,
    /// Text and logo.
    Both,
}

/// Light, lens, sensor and files that are not ideal; by default none is.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FrameEffects {
    /// Overlay that is burnt into the frames, if any. The survey folder then has `overlay.png`, in
    /// which the pixels that it covers in any frame are black.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlay: Option<OverlayParts>,
    /// Flicker of the light under a rolling exposure, if any.
    #[serde(flatten)]
    pub flicker: Option<Flicker>,
    /// Exponent G of the sensor's tone curve, if any: `255 (x/255)^(1/G)`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f64>,
    /// Maximum factor F of a step of the exposure, if there are any.
    ///
    /// About every tenth frame the exposure changes by a factor between 1/F and F and stays; it
    /// remains between 1/F and F times that of the first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure_step: Option<f64>,
    /// Mean path of wall points over the image during the exposure of a frame, pixels; 0 for none.
    #[serde(skip_serializing_if = "is_zero")]
    pub motion_blur_px: f64,
    /// 1-σ of the Gaussian point spread of a lens out of focus, pixels; 0 for none.
    #[serde(skip_serializing_if = "is_zero")]
    pub defocus_px: f64,
    /// Quality of JPEG frames, 1 to 100; `None` for PNG frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jpeg_quality: Option<u8>,
    /// Share of the picture under dark soft specks that are fixed to the lens, percent.
    #[serde(skip_serializing_if = "is_zero")]
    pub dust_percent: f64,
    /// Little light: the mean grey level is about 12, with the noise of a bright picture.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub dark: bool,
}

/// True for zero, which the record leaves out.
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl FrameEffects {
    /// Validates every value for frames of the given bit depth.
    ///
    /// # Errors
    /// [`SimulateError::Option`] with the name of the first impossible option.
    pub(crate) fn validate(&self, bits: BitDepth) -> Result<(), SimulateError> {
        if let Some(flicker) = &self.flicker {
            flicker.validate()?;
        }
        check_option(
            self.gamma.is_none_or(|gamma| (0.2..=5.0).contains(&gamma)),
            "the gamma of the tone curve must lie between 0.2 and 5",
        )?;
        check_option(
            self.exposure_step
                .is_none_or(|step| (1.0..=16.0).contains(&step)),
            "the step of the exposure must be a factor between 1 and 16",
        )?;
        check_option(
            (0.0..=100.0).contains(&self.motion_blur_px),
            "the motion blur may be 0 to 100 pixels long",
        )?;
        check_option(
            (0.0..=50.0).contains(&self.defocus_px),
            "the defocus may have a sigma of 0 to 50 pixels",
        )?;
        check_option(
            self.jpeg_quality.is_none_or(|q| (1..=100).contains(&q)),
            "the quality of JPEG frames must lie between 1 and 100",
        )?;
        check_option(
            self.jpeg_quality.is_none() || bits == BitDepth::Eight,
            "JPEG frames have 8 bits",
        )?;
        check_option(
            (0.0..=50.0).contains(&self.dust_percent),
            "dust may cover 0 to 50 percent of the picture",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_effects_are_refused() {
        let none = FrameEffects::default;
        let flicker = |percent, bands| Some(Flicker { percent, bands });
        none().validate(BitDepth::Sixteen).unwrap();
        let wrong = [
            FrameEffects {
                flicker: flicker(101.0, 2.0),
                ..none()
            },
            FrameEffects {
                flicker: flicker(10.0, f64::NAN),
                ..none()
            },
            FrameEffects {
                gamma: Some(0.0),
                ..none()
            },
            FrameEffects {
                exposure_step: Some(0.5),
                ..none()
            },
            FrameEffects {
                motion_blur_px: -1.0,
                ..none()
            },
            FrameEffects {
                defocus_px: f64::INFINITY,
                ..none()
            },
            FrameEffects {
                jpeg_quality: Some(0),
                ..none()
            },
            FrameEffects {
                dust_percent: 51.0,
                ..none()
            },
        ];
        for effects in wrong {
            assert!(effects.validate(BitDepth::Eight).is_err(), "{effects:?}");
        }
        let jpeg = FrameEffects {
            jpeg_quality: Some(80),
            ..none()
        };
        jpeg.validate(BitDepth::Eight).unwrap();
        assert!(jpeg.validate(BitDepth::Sixteen).is_err());
    }

    /// Keys stand beside those of the other options, and only those that are in use.
    #[test]
    fn the_record_has_what_is_in_use() {
        let effects = FrameEffects {
            overlay: Some(OverlayParts::Both),
            flicker: Some(Flicker {
                percent: 8.0,
                bands: 2.5,
            }),
            ..FrameEffects::default()
        };
        let record = serde_json::to_string(&effects).unwrap();
        assert_eq!(
            record,
            r#"{"overlay":"both","flicker_percent":8.0,"flicker_bands":2.5}"#
        );
        let none = serde_json::to_string(&FrameEffects::default()).unwrap();
        assert_eq!(none, "{}");
    }
}
