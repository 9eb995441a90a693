//! What refining and stitching will take.

use crate::refine::RefineOptions;
use crate::survey::Survey;
use serde::Serialize;

/// Processor time of a frame that does not depend on its size, seconds, and of a pixel: from
/// surveys of 320 × 240 to 640 × 480 px on one core of a cloud machine. A guess for any other.
const FRAME_S: f64 = 0.035;
const PIXEL_S: f64 = 0.14e-6;
/// Bytes of a frame's pyramid per pixel, and of the equations per frame.
const PYRAMID_BYTES: f64 = 6.0;
const EQUATIONS_BYTES: f64 = 0.2e6;

/// Rough sizes, for planning.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Effort {
    /// Time to refine on this machine's cores, seconds, within a factor of two or three.
    pub refine_s: f64,
    /// Memory to refine, bytes.
    pub refine_bytes: u64,
    /// Width and height of the panorama at the frames' own resolution, pixels.
    pub panorama_px: [u64; 2],
}

impl Effort {
    pub(super) fn of(survey: &Survey, px_per_metre: f64) -> Self {
        let frames = survey.frames.len() as f64;
        let pixels = f64::from(survey.camera.width) * f64::from(survey.camera.height);
        let cache = RefineOptions::default().cache_bytes as f64;
        let poses = || survey.initial.iter().map(|stamped| stamped.pose.t_wc);
        let chainage = || poses().map(|t_wc| survey.surface.chainage_m(&t_wc));
        let from_m = chainage().fold(f64::INFINITY, f64::min);
        let to_m = chainage().fold(f64::NEG_INFINITY, f64::max);
        // Half a frame's height beyond the first and the last camera.
        let frame_m = f64::from(survey.camera.height) / px_per_metre;
        let px = |metres: f64| (metres * px_per_metre).max(0.0) as u64;
        Self {
            refine_s: frames * (FRAME_S + PIXEL_S * pixels) / rayon::current_num_threads() as f64,
            refine_bytes: ((frames * PYRAMID_BYTES * pixels).min(cache) + frames * EQUATIONS_BYTES)
                as u64,
            panorama_px: [
                px(survey.surface.perimeter_m()),
                px(to_m - from_m + frame_m),
            ],
        }
    }
}
