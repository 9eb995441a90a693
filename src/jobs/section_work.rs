//! Processor time and memory that the tasks of a section need.

use super::job::{Needs, SectionStep};
use super::section_calls::Part;
use crate::check::{
    Effort, JOIN_SHARE, join_bytes, refine_bytes, refine_processor_s, shard_bytes, shard_share,
};
use crate::refine::RefineOptions;
use crate::render::native_px_per_metre;
use crate::survey::Survey;

/// Processor time of a pixel of a panorama, seconds, with its share of decoding and writing.
/// Measured on surveys of 320 × 240 to 640 × 480 px on a cloud machine.
const TIME_PER_PANORAMA_PIXEL_S: f64 = 0.1e-6;
/// Share of the processor time of a panorama that its exposures and seams take, if frames are not
/// kept for drawing.
const SEAMS_SHARE: f64 = 0.6;
/// Share that putting it together from shards takes.
const PANORAMA_JOIN_SHARE: f64 = 0.1;
/// Share of the processor time of a panorama that cutting 3D Tiles from shards takes.
const TILES_JOIN_SHARE: f64 = 0.4;
/// Panoramas that a report compares: of initial and of refined poses.
const PANORAMAS_OF_REPORT: f64 = 2.0;
/// Processor time of starting the program, seconds.
const START_S: f64 = 1.0;
/// Memory of the program beside what it works on, bytes.
const PROGRAM_BYTES: u64 = 192 << 20;
/// Memory for parts of a panorama and pictures of frames, bytes.
const PANORAMA_BYTES: u64 = 512 << 20;
/// Times that a task may take as long as expected, which is right within a factor of three or so,
/// before it is ended.
const LIMIT_FACTOR: f64 = 40.0;
/// Least time before a task is ended, seconds.
const MIN_LIMIT_S: f64 = 600.0;

/// The work of a section.
pub struct SectionWork {
    /// Processor time of refining, seconds.
    refine_s: f64,
    /// Memory of refining, or of joining shards, bytes.
    refine_bytes: u64,
    /// Number of shards.
    pub shards: usize,
    /// Share of the processor time of refining that a shard takes, and one that joins them.
    shares: [f64; 2],
    /// Memory of refining a shard, bytes.
    shard_bytes: u64,
    /// Pixels of the panorama at the frames' resolution.
    panorama_px: f64,
}

impl SectionWork {
    /// The work of a survey in so many shards, each task on so many processors.
    pub fn of(survey: &Survey, shards: usize, cores: u16) -> Self {
        let threads = usize::from(cores);
        let surface = survey.surface.as_ref();
        // Cameras that show no wall make no panorama: refining says so.
        let px_per_metre = native_px_per_metre(surface, &survey.cameras, &survey.initial_poses());
        let effort = Effort::of(survey, px_per_metre.unwrap_or_default());
        let [width, height] = effort.panorama_px;
        Self {
            refine_s: refine_processor_s(survey, &RefineOptions::default()),
            refine_bytes: match shards {
                1 => refine_bytes(survey, threads),
                _ => join_bytes(survey),
            },
            shards,
            shares: match shards {
                1 => [0.0, 1.0],
                _ => [shard_share(survey, shards), JOIN_SHARE],
            },
            shard_bytes: shard_bytes(survey, shards, threads),
            panorama_px: width as f64 * height as f64,
        }
    }

    /// Needs of a part of a step.
    pub fn needs(&self, step: SectionStep, part: Part, cores: u16) -> Needs {
        let panorama_s = TIME_PER_PANORAMA_PIXEL_S * self.panorama_px;
        let (processor_s, bytes) = match (step, part) {
            (SectionStep::Refine, Part::Shard(_)) => {
                (self.shares[0] * self.refine_s, self.shard_bytes)
            }
            (SectionStep::Refine, _) => (self.shares[1] * self.refine_s, self.refine_bytes),
            (SectionStep::Stitch | SectionStep::Export, Part::Seams) => {
                (SEAMS_SHARE * panorama_s, PANORAMA_BYTES)
            }
            (SectionStep::Stitch | SectionStep::Export, Part::Shard(shard)) => {
                (panorama_s / shard.of as f64, PANORAMA_BYTES)
            }
            (SectionStep::Stitch, Part::Whole) if self.shards > 1 => {
                (PANORAMA_JOIN_SHARE * panorama_s, PANORAMA_BYTES)
            }
            (SectionStep::Export, Part::Whole) if self.shards > 1 => {
                (TILES_JOIN_SHARE * panorama_s, PANORAMA_BYTES)
            }
            (SectionStep::Stitch | SectionStep::Export, _) => (panorama_s, PANORAMA_BYTES),
            (SectionStep::Report, _) => (PANORAMAS_OF_REPORT * panorama_s, PANORAMA_BYTES),
        };
        needs(processor_s, bytes, cores)
    }
}

/// Needs of a task of this processor time (seconds), and this memory beside that of the program.
pub fn needs(processor_s: f64, bytes: u64, cores: u16) -> Needs {
    let seconds = START_S + processor_s / f64::from(cores);
    Needs {
        cores,
        memory_bytes: PROGRAM_BYTES + bytes,
        seconds,
        limit_seconds: (LIMIT_FACTOR * seconds).max(MIN_LIMIT_S),
    }
}
