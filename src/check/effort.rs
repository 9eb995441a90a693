//! Time and memory that refining and stitching need.

use crate::refine::{
    JOIN_CACHE_BYTES, RefineOptions, SHARD_CACHE_BYTES, Shard, focal_search_registrations,
};
use crate::survey::{CalibrationGroup, Survey};
use serde::Serialize;

/// Processor time per frame that does not depend on its size, seconds. Measured, as
/// [`TIME_PER_PIXEL_S`], on surveys of 320 × 240 to 640 × 480 px on one core of a cloud machine.
const TIME_PER_FRAME_S: f64 = 0.06;
/// Processor time per pixel of a frame, seconds.
const TIME_PER_PIXEL_S: f64 = 0.25e-6;
/// Processor time per frame and cubic degree in which it is searched for, seconds. Measured on
/// surveys of 320 × 240 px with 1-σ from 5° to 20°; the search is at a resolution of its own, so
/// that the time does not depend on the size of the frames.
const TIME_PER_SEARCH_S: f64 = 4e-4;
/// Processor time of registering a frame on the one before it in the search for a focal length,
/// beside that of the search volume, seconds. Measured as [`TIME_PER_SEARCH_S`].
const TIME_PER_REGISTRATION_S: f64 = 0.02;
/// Time with the wall solved jointly, relative to the time without: between ten and twenty.
const JOINT_FACTOR: f64 = 15.0;
/// Processor time of the last solves and the assessment, which come after shards are joined, over
/// that of a whole refinement.
pub const JOIN_SHARE: f64 = 0.35;
/// Memory of a frame's pyramid per pixel, bytes.
const PYRAMID_BYTES_PER_PIXEL: f64 = 6.0;
/// Memory of refining any survey, bytes. Measured, as the next four, on surveys of 24 to 240 frames
/// of 320 × 240 and 640 × 480 px.
const ANY_SURVEY_BYTES: f64 = 10e6;
/// Memory of each thread, bytes.
const BYTES_PER_THREAD: f64 = 12e6;
/// Frames of the longest windows of tracking.
const WINDOW_FRAMES: f64 = 160.0;
/// Memory of each of them in each thread, bytes.
const WINDOW_BYTES_PER_THREAD: f64 = 0.1e6;
/// Memory of each of their pixels, bytes.
const WINDOW_BYTES_PER_PIXEL: f64 = 1.0;
/// Memory per frame that is not its picture's, bytes: equations and observations. Measured, as the
/// two after it, on up to 12,000 frames of 320 × 240 px with twelve a turn.
const BYTES_PER_FRAME: f64 = 0.13e6;
/// Memory of a shard per frame that is not its picture's, bytes.
const SHARD_BYTES_PER_FRAME: f64 = 0.1e6;
/// Memory of joining shards per frame that is not its picture's, bytes.
const JOIN_BYTES_PER_FRAME: f64 = 0.053e6;

/// Rough estimates of time, memory and size.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct Effort {
    /// Time of refine on all cores of this machine, seconds, within a factor of two or three.
    pub refine_s: f64,
    /// Memory of refine, bytes.
    pub refine_bytes: u64,
    /// Width and height of the panorama at the frames' own resolution, pixels.
    pub panorama_px: [u64; 2],
}

impl Effort {
    /// Estimates the effort from the number and the size of the frames; `px_per_metre`: their
    /// resolution at the wall.
    pub fn of(survey: &Survey, px_per_metre: f64) -> Self {
        let poses = || survey.initial.iter().map(|stamped| stamped.pose.t_wc);
        let chainage = || poses().map(|t_wc| survey.surface.chainage_m(&t_wc));
        let from_m = chainage().fold(f64::INFINITY, f64::min);
        let to_m = chainage().fold(f64::NEG_INFINITY, f64::max);
        // The panorama extends by half a frame beyond the first and the last camera.
        let frame_m = f64::from(survey.cameras.size()[1]) / px_per_metre;
        let px = |metres: f64| (metres * px_per_metre).max(0.0) as u64;
        Self {
            refine_s: refine_s(survey, &RefineOptions::default()),
            refine_bytes: refine_bytes(survey, rayon::current_num_threads()),
            panorama_px: [
                px(survey.surface.perimeter_m()),
                px(to_m - from_m + frame_m),
            ],
        }
    }
}

/// Time of refine on all cores of this machine, seconds, within a factor of two or three.
pub fn refine_s(survey: &Survey, options: &RefineOptions) -> f64 {
    refine_processor_s(survey, options) / rayon::current_num_threads() as f64
}

/// Processor time of refine, seconds, within a factor of two or three.
pub fn refine_processor_s(survey: &Survey, options: &RefineOptions) -> f64 {
    let frames = survey.frames.len() as f64;
    let [width, height] = survey.cameras.size().map(f64::from);
    let pixels = width * height;
    let radius_m = survey.file.tunnel.nominal_m();
    let volume_deg3 = survey.prior.search_volume_deg3(radius_m);
    let search_s = TIME_PER_SEARCH_S * volume_deg3;
    let factor = if options.joint { JOINT_FACTOR } else { 1.0 };
    let frames_s = frames * factor * (TIME_PER_FRAME_S + TIME_PER_PIXEL_S * pixels + search_s);
    let focal_s = focal_registrations(survey, options) * (TIME_PER_REGISTRATION_S + search_s);
    frames_s + focal_s
}

/// Number of registrations by which a focal length that is hardly known is searched for.
fn focal_registrations(survey: &Survey, options: &RefineOptions) -> f64 {
    let focal = CalibrationGroup::Focal;
    let section = survey.file.calibrate.clone().unwrap_or_default();
    let unknowns = options.calibrate.as_ref().unwrap_or(&section.unknowns);
    let sigma = 0.01 * section.focal_sigma_percent;
    match unknowns.contains(&focal) {
        true => focal_search_registrations(sigma, survey.frames.len()) as f64,
        false => 0.0,
    }
}

/// Memory of refine on so many threads, bytes, beside what the program takes for anything.
pub fn refine_bytes(survey: &Survey, threads: usize) -> u64 {
    let cache_bytes = RefineOptions::default().cache_bytes;
    let frames = survey.frames.len();
    bytes_of_frames(survey, frames, threads, (cache_bytes, BYTES_PER_FRAME))
}

/// Memory of refining one of so many shards on so many threads, bytes, beside what the program
/// takes for anything.
pub fn shard_bytes(survey: &Survey, shards: usize, threads: usize) -> u64 {
    let frames = shard_frames(survey, shards);
    let memory = (SHARD_CACHE_BYTES, SHARD_BYTES_PER_FRAME);
    bytes_of_frames(survey, frames, threads, memory)
}

/// Memory of joining shards on so many threads, bytes, beside what the program takes for anything.
pub fn join_bytes(survey: &Survey, threads: usize) -> u64 {
    let memory = (JOIN_CACHE_BYTES, JOIN_BYTES_PER_FRAME);
    bytes_of_frames(survey, survey.frames.len(), threads, memory)
}

/// Processor time of refining one of so many shards over that of refining the survey.
pub fn shard_share(survey: &Survey, shards: usize) -> f64 {
    let frames = shard_frames(survey, shards) as f64 / survey.frames.len().max(1) as f64;
    (1.0 - JOIN_SHARE) * frames
}

/// Frames of the largest of so many shards.
fn shard_frames(survey: &Survey, shards: usize) -> usize {
    let (frames, cameras) = (survey.frames.len(), survey.cameras.count());
    let all = (1..=shards).filter_map(|number| Shard::new(number, shards, frames, cameras));
    let most = all.map(|shard| shard.frames.len()).max();
    most.unwrap_or(frames)
}

/// Memory of refining frames of a survey on so many threads, bytes, with at most `cache_bytes` for
/// decoded ones and `bytes_per_frame` beside.
fn bytes_of_frames(
    survey: &Survey,
    frames: usize,
    threads: usize,
    (cache_bytes, bytes_per_frame): (usize, f64),
) -> u64 {
    let frames = frames as f64;
    let [width, height] = survey.cameras.size().map(f64::from);
    let pixels = width * height;
    let cache = (frames * PYRAMID_BYTES_PER_PIXEL * pixels).min(cache_bytes as f64);
    let threads = threads as f64;
    let frame_of_window = threads * WINDOW_BYTES_PER_THREAD + pixels * WINDOW_BYTES_PER_PIXEL;
    let window = frames.min(WINDOW_FRAMES) * frame_of_window;
    let any_survey = ANY_SURVEY_BYTES + threads * BYTES_PER_THREAD;
    (any_survey + window + cache + frames * bytes_per_frame) as u64
}
