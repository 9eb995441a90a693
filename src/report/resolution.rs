//! How finely the panoramas of a report are compared.

use super::ReportError;
use crate::render::{Canvas, PictureCache, level_for, native_px_per_metre, place};
use crate::survey::Survey;
use crate::trajectory::Pose;

/// Most pixels of a panorama that is compared.
const MOST_PIXELS: usize = 40_000_000;
/// Most memory for frames, bytes.
const MOST_BYTES: u64 = 2 << 30;
/// By how much the resolution is lowered at a time.
const COARSER: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Pixels per metre at which all frames and the panoramas of a survey fit into the memory; `None`
/// for the frames' own.
///
/// # Errors
/// [`ReportError::Render`]: poses that lie nowhere on the wall, frames that cannot be read.
pub fn resolution(survey: &Survey, poses: &[Pose]) -> Result<Option<f64>, ReportError> {
    let (surface, camera) = (survey.surface.as_ref(), &survey.camera);
    let placements = place(surface, camera, poses, &survey.shutter())?;
    let native = native_px_per_metre(surface, camera, poses)?;
    let mut px_per_metre = native;
    loop {
        // Far beyond what is possible before it is coarser, a canvas has no size.
        let pixels = Canvas::of_placements(surface, &placements, px_per_metre)
            .map_or(usize::MAX, |canvas| canvas.pixels());
        let level = level_for(camera, native, px_per_metre);
        let one = survey.frames.first(1);
        let bytes = PictureCache::open(&one, camera, level)?.frame_bytes() * poses.len() as u64;
        // Frames cannot be halved without end.
        let fits = bytes <= MOST_BYTES || px_per_metre < native / 64.0;
        if (pixels <= MOST_PIXELS && fits) || px_per_metre < 1e-6 * native {
            return Ok((px_per_metre != native).then_some(px_per_metre));
        }
        px_per_metre *= COARSER;
    }
}
