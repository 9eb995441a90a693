//! Processor time and memory that the tasks of a section need.

use super::job::{Needs, SectionStep};
use super::panorama_work::PanoramaWork;
use super::section_calls::Part;
use crate::check::{
    JOIN_SHARE, join_bytes, refine_bytes, refine_processor_s, shard_bytes, shard_share,
};
use crate::refine::RefineOptions;
use crate::survey::Survey;

/// Processor time of starting the program, seconds.
const START_S: f64 = 1.0;
/// Memory of the program beside what it works on, bytes.
const PROGRAM_BYTES: u64 = 20 << 20;
/// Memory that a task asks for over what such tasks were measured to take.
const MEMORY_MARGIN: f64 = 1.4;
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
    /// The work on its panoramas.
    panoramas: PanoramaWork,
}

impl SectionWork {
    /// The work of a survey in so many shards, each task on so many processors.
    pub fn of(survey: &Survey, shards: usize, cores: u16) -> Self {
        let threads = usize::from(cores);
        Self {
            refine_s: refine_processor_s(survey, &RefineOptions::default()),
            refine_bytes: match shards {
                1 => refine_bytes(survey, threads),
                _ => join_bytes(survey, threads),
            },
            shards,
            shares: match shards {
                1 => [0.0, 1.0],
                _ => [shard_share(survey, shards), JOIN_SHARE],
            },
            shard_bytes: shard_bytes(survey, shards, threads),
            panoramas: PanoramaWork::of(survey, threads),
        }
    }

    /// Needs of a part of a step.
    pub fn needs(&self, step: SectionStep, part: Part, cores: u16) -> Needs {
        let (processor_s, bytes) = match (step, part) {
            (SectionStep::Refine, Part::Shard(_)) => {
                (self.shares[0] * self.refine_s, self.shard_bytes)
            }
            (SectionStep::Refine, _) => (self.shares[1] * self.refine_s, self.refine_bytes),
            _ => (
                self.panoramas.seconds(step, part, self.shards),
                self.panoramas.bytes(step, part, self.shards),
            ),
        };
        needs(processor_s, bytes, cores)
    }
}

/// Needs of a task of this processor time (seconds), and this memory beside that of the program.
pub fn needs(processor_s: f64, bytes: u64, cores: u16) -> Needs {
    let seconds = START_S + processor_s / f64::from(cores);
    Needs {
        cores,
        memory_bytes: (MEMORY_MARGIN * (PROGRAM_BYTES + bytes) as f64) as u64,
        seconds,
        limit_seconds: (LIMIT_FACTOR * seconds).max(MIN_LIMIT_S),
    }
}
