//! Exposure, noise and texture of a dozen frames.

use super::statistics::median_or_zero;
use crate::frames::{FrameError, FrameFile, GreyImage, StoredFrame, noise_sigma};
use crate::survey::Survey;
use serde::Serialize;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Largest number of frames that are decoded.
const MAX_DECODED_FRAMES: usize = 12;
/// Variance of the difference of neighbours in a half-size image, relative to the noise variance of
/// a pixel. Halving filters with `[1 3 3 1]/8` along each axis: along one axis the variance is
/// `20/64`, and the covariance of neighbours `6/64`.
const HALVED_NOISE_FACTOR: f64 = 2.0 * (20.0 - 6.0) * 20.0 / (64.0 * 64.0);
/// Least noise that is assumed, grey levels: that of rounding.
pub(super) const MIN_NOISE_GREY: f64 = 0.3;
/// Largest number of faults that are listed.
const MAX_LISTED_FAULTS: usize = 5;

/// Exposure, noise and texture, medians over a dozen frames.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct PictureCheck {
    /// Number of decoded frames.
    pub decoded: usize,
    /// Mean grey level, 0–255.
    pub grey: f64,
    /// Share of saturated pixels (black or white) among those that the mask does not hide, 0–1.
    pub clipped: f64,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
    /// Texture: RMS gradient at half size without the contribution of the noise, grey levels per
    /// full-size pixel.
    pub slope_grey_per_px: f64,
    /// 1-σ of a frame's registration against a known wall by all of its `n` pixels:
    /// `σ/(gradient √n)`, pixels. The refinement reaches a few times that. None if there is no
    /// texture.
    pub sigma_px: Option<f64>,
}

impl PictureCheck {
    /// The accuracy of a frame's registration in words, with so many decimals.
    pub fn describe_registration(&self, decimals: usize) -> String {
        let bound =
            |sigma_px: f64| format!("frames can be registered to {sigma_px:.decimals$} px at best");
        self.sigma_px
            .map_or("frames cannot be registered".to_owned(), bound)
    }

    /// Decodes a dozen frames and examines start and end of all; also returns the faults.
    pub(super) fn of(survey: &Survey) -> (Self, Vec<String>) {
        let [width, height] = survey.cameras.size();
        let examined = (survey.frames).par_map(|file| file.examine(width, height).err());
        let step = survey.frames.len().div_ceil(MAX_DECODED_FRAMES).max(1);
        let sound = survey.frames.iter().zip(&examined);
        let sound = sound.filter_map(|(file, fault)| fault.is_none().then_some(file));
        let sampled: Vec<&FrameFile> = sound.step_by(step).collect();
        let mut faults = faults_in_words(examined);
        let decoded: Vec<Result<GreyImage, String>> =
            sampled.par_map(|file| match StoredFrame::decode(file, width, height) {
                Ok(frame) => {
                    let mut grey = frame.grey();
                    if let Some(mask) = survey.frames.masks().of(file.index) {
                        mask.blank(&mut grey);
                    }
                    Ok(grey)
                }
                Err(error) => Err(error.to_string()),
            });
        let hidden = survey.frames.masks().masked_fraction();
        let mut pictures = Vec::new();
        for picture in decoded {
            match picture {
                Ok(picture) => pictures.push(measure(&picture, hidden)),
                Err(fault) => faults.push(fault),
            }
        }
        let of = |value: fn(&Self) -> f64| median_or_zero(pictures.iter().map(value));
        let check = Self {
            decoded: pictures.len(),
            grey: of(|p| p.grey),
            clipped: of(|p| p.clipped),
            noise_grey: of(|p| p.noise_grey),
            slope_grey_per_px: of(|p| p.slope_grey_per_px),
            sigma_px: Some(of(|p| p.sigma_px.unwrap_or(f64::INFINITY)))
                .filter(|sigma_px| sigma_px.is_finite()),
        };
        (check, faults)
    }
}

/// The errors of the frames in words; one, if all have the same.
fn faults_in_words(errors: Vec<Option<FrameError>>) -> Vec<String> {
    let count = errors.len();
    let mut errors: Vec<FrameError> = errors.into_iter().flatten().collect();
    let reasons: Vec<String> = errors.iter().map(FrameError::reason).collect();
    let is_of_all = reasons.len() == count && reasons.iter().all(|other| *other == reasons[0]);
    if is_of_all && count > 0 {
        return vec![errors.swap_remove(0).of_all(count).to_string()];
    }
    let listed = errors.iter().take(MAX_LISTED_FAULTS);
    let mut faults: Vec<String> = listed.map(ToString::to_string).collect();
    if errors.len() > MAX_LISTED_FAULTS {
        let more = errors.len() - MAX_LISTED_FAULTS;
        faults.push(format!("and {more} more frames have such faults"));
    }
    faults
}

/// Measures an image; the mask hides a share `hidden` of its pixels, whose values are NaN.
fn measure(picture: &GreyImage, hidden: f64) -> PictureCheck {
    let pixels = ((1.0 - hidden) * picture.data().len() as f64).max(1.0);
    let (mut sum, mut known) = (0.0, 0.0);
    for value in picture.data().iter().filter(|value| !value.is_nan()) {
        sum += f64::from(*value);
        known += 1.0;
    }
    let noise_grey = noise_sigma(picture).unwrap_or(0.0);
    let noise_slope = HALVED_NOISE_FACTOR * noise_grey.powi(2);
    let half = picture.halved();
    let (mut squares, mut count) = (0.0, 0.0);
    for y in 0..half.height().saturating_sub(1) {
        for x in 0..half.width().saturating_sub(1) {
            let here = half.at(x, y);
            for next in [half.at(x + 1, y), half.at(x, y + 1)] {
                let difference = f64::from(next - here);
                if difference.is_finite() {
                    squares += difference.powi(2);
                    count += 1.0;
                }
            }
        }
    }
    let variance = if count > 0.0 { squares / count } else { 0.0 };
    // Neighbours of the half-size picture are two pixels apart.
    let slope = 0.5 * (variance - noise_slope).max(0.0).sqrt();
    PictureCheck {
        decoded: 1,
        grey: if known > 0.0 { sum / known } else { 0.0 },
        clipped: 1.0 - known / pixels,
        noise_grey,
        slope_grey_per_px: slope,
        sigma_px: (slope > 0.0).then(|| noise_grey.max(MIN_NOISE_GREY) / (slope * pixels.sqrt())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn texture_is_measured_without_the_noise() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let noise = Normal::new(0.0f32, 3.0).unwrap();
        let mut noisy = |slope: f32| {
            let value = |k: usize| 100.0 + slope * 20.0 * ((k % 256) as f32 / 20.0).sin();
            let data = (0..256 * 256).map(|k| value(k) + noise.sample(&mut rng));
            measure(&GreyImage::new(256, 256, data.collect()), 0.0)
        };
        let flat = noisy(0.0);
        assert!((flat.noise_grey / 3.0 - 1.0).abs() < 0.1, "{flat:?}");
        assert!(flat.slope_grey_per_px < 0.2, "{flat:?}");
        // Slopes of 2 cos along one of two axes: an RMS of 1 over both.
        let waves = noisy(2.0);
        assert!((waves.slope_grey_per_px - 1.0).abs() < 0.1, "{waves:?}");
        let px = |check: &PictureCheck| check.sigma_px.unwrap_or(f64::INFINITY);
        assert!(px(&waves) < px(&flat));
    }

    #[test]
    fn blank_pictures_cannot_be_registered() {
        let blank = measure(&GreyImage::new(64, 64, vec![90.0; 64 * 64]), 0.0);
        assert_eq!(blank.sigma_px, None);
        assert_eq!(
            blank.describe_registration(1),
            "frames cannot be registered"
        );
    }

    #[test]
    fn clipped_pixels_are_counted() {
        let mut picture = GreyImage::new(64, 64, vec![90.0; 64 * 64]);
        picture.data_mut()[..64 * 16].fill(f32::NAN);
        let measured = measure(&picture, 0.0);
        assert_eq!((measured.clipped, measured.grey), (0.25, 90.0));
        assert_eq!(measure(&picture, 0.25).clipped, 0.0);
    }
}
