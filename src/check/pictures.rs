//! What the pictures are like.

use super::median;
use crate::frames::{FrameFile, GreyImage, StoredFrame, noise_sigma};
use crate::survey::Survey;
use rayon::prelude::*;
use serde::Serialize;

/// Frames that are decoded.
const DECODED: usize = 12;
/// Variance of the difference of neighbours in a half-size picture over that of a pixel's noise:
/// halving filters with `[1 3 3 1]/8` along each axis, so that along one axis the variance is
/// `20/64`, and `6/64` of it is shared by neighbours.
const HALVED_NOISE: f64 = 2.0 * (20.0 - 6.0) * 20.0 / (64.0 * 64.0);
/// Faults that are listed.
const LISTED: usize = 5;

/// Medians over a dozen frames.
#[derive(Clone, Copy, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct PictureCheck {
    /// How many were decoded.
    pub decoded: usize,
    /// Mean grey level of 255.
    pub grey: f64,
    /// Share of pixels that are full white or black, of those that the mask does not hide.
    pub clipped: f64,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
    /// Texture: RMS slope at half size without the noise's part, grey levels per pixel of full
    /// size.
    pub slope_grey_per_px: f64,
    /// 1-σ to which all pixels of one frame can place it on a wall that is known: `σ/(slope √n)`,
    /// pixels. What can be reached is a few times that.
    pub sigma_px: f64,
}

impl PictureCheck {
    /// Decodes a dozen frames and measures all others by their headers; faults beside it.
    pub(super) fn of(survey: &Survey) -> (Self, Vec<String>) {
        let (width, height) = (survey.camera.width, survey.camera.height);
        let mut faults: Vec<String> = survey
            .frames
            .par_iter()
            .filter_map(|file| fault(file, [width, height]))
            .collect();
        if faults.len() > LISTED {
            let more = faults.len() - LISTED;
            faults.truncate(LISTED);
            faults.push(format!("and {more} frames more are like that"));
        }
        let step = survey.frames.len().div_ceil(DECODED).max(1);
        let asked: Vec<&FrameFile> = survey.frames.iter().step_by(step).collect();
        let decoded: Vec<Result<GreyImage, String>> = asked
            .par_iter()
            .map(|file| match StoredFrame::decode(file, width, height) {
                Ok(frame) => {
                    let mut grey = frame.grey();
                    if let Some(mask) = survey.frames.mask() {
                        mask.blank(&mut grey);
                    }
                    Ok(grey)
                }
                Err(error) => Err(error.to_string()),
            })
            .collect();
        let hidden = survey
            .frames
            .mask()
            .map_or(0.0, |mask| mask.masked_fraction());
        let mut pictures = Vec::new();
        for picture in decoded {
            match picture {
                Ok(picture) => pictures.push(measure(&picture, hidden)),
                Err(fault) if !faults.contains(&fault) => faults.push(fault),
                Err(_) => {}
            }
        }
        let of = |value: fn(&Self) -> f64| median(pictures.iter().map(value));
        let check = Self {
            decoded: pictures.len(),
            grey: of(|p| p.grey),
            clipped: of(|p| p.clipped),
            noise_grey: of(|p| p.noise_grey),
            slope_grey_per_px: of(|p| p.slope_grey_per_px),
            sigma_px: of(|p| p.sigma_px),
        };
        (check, faults)
    }
}

/// What the header of a frame's file says is wrong with it.
fn fault(file: &FrameFile, size: [u32; 2]) -> Option<String> {
    let name = format!("frame {} ({})", file.index, file.path.display());
    match file.size() {
        Err(error) => Some(error.to_string()),
        Ok((width, height)) if [width, height] != size => Some(format!(
            "{name}: {width} × {height} px, but the calibration is for {} × {} px",
            size[0], size[1]
        )),
        Ok(_) => None,
    }
}

/// Measures a picture of whose pixels a share is `hidden`, and has no value therefore.
fn measure(picture: &GreyImage, hidden: f64) -> PictureCheck {
    let pixels = ((1.0 - hidden) * picture.data().len() as f64).max(1.0);
    let (mut sum, mut known) = (0.0, 0.0);
    for value in picture.data().iter().filter(|value| !value.is_nan()) {
        sum += f64::from(*value);
        known += 1.0;
    }
    let noise_grey = noise_sigma(picture).unwrap_or(0.0);
    let noise_slope = HALVED_NOISE * noise_grey.powi(2);
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
        sigma_px: noise_grey.max(0.3) / (slope * pixels.sqrt()).max(1e-9),
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
        assert!(waves.sigma_px < flat.sigma_px);
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
