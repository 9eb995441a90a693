//! Resolution at which the panoramas of a report are compared.

use super::error::ReportError;
use crate::render::{Canvas, PictureCache, level_for, native_px_per_metre, place_frames};
use crate::survey::Survey;
use crate::trajectory::Pose;

/// Largest number of pixels of a compared panorama.
pub const MAX_PIXELS: usize = 40_000_000;
/// Largest memory for frames, bytes.
pub const MAX_FRAME_BYTES: u64 = 2 << 30;
/// Factor by which the resolution is lowered per iteration.
const RESOLUTION_STEP: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Chooses the resolution, pixels per metre, at which all frames and the panoramas of a survey fit
/// into the memory; `None` for the frames' own.
///
/// # Errors
/// [`ReportError::Render`]: poses that lie nowhere on the wall, frames that cannot be read.
pub fn choose_resolution(survey: &Survey, poses: &[Pose]) -> Result<Option<f64>, ReportError> {
    let (surface, cameras) = (survey.surface.as_ref(), &survey.cameras);
    let placements = place_frames(surface, cameras, poses, &survey.shutter())?;
    let native = native_px_per_metre(surface, cameras, poses)?;
    let mut px_per_metre = native;
    loop {
        // A canvas that is far too fine is an error, so it counts as too large.
        let pixels = Canvas::of_placements(surface, &placements, px_per_metre)
            .map_or(usize::MAX, |canvas| canvas.pixels());
        let level = level_for(cameras.shorter_side(), native, px_per_metre);
        let one = survey.frames.first(1);
        let bytes = PictureCache::open(&one, cameras, level)?.frame_bytes() * poses.len() as u64;
        // Frames are halved at most six times.
        let fits = bytes <= MAX_FRAME_BYTES || px_per_metre < native / 64.0;
        if (pixels <= MAX_PIXELS && fits) || px_per_metre < 1e-6 * native {
            return Ok((px_per_metre != native).then_some(px_per_metre));
        }
        px_per_metre *= RESOLUTION_STEP;
    }
}
