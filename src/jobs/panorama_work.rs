//! Processor time and memory of the panoramas of a section: as pictures, 3D Tiles and in a report.

use super::job::SectionStep;
use super::section_calls::Part;
use crate::inspect::TilesTarget;
use crate::render::{PlannedMemory, RenderError, Stitch, StitchOptions};
use crate::report::{MAX_FRAME_BYTES, MAX_PIXELS};
use crate::survey::Survey;

/// Processor time of a pixel of a panorama, seconds, with its share of decoding and writing.
/// Measured, as all of it here, on surveys of 320 × 240 to 640 × 480 px on a cloud machine.
const TIME_PER_PIXEL_S: f64 = 0.17e-6;
/// Share of it that exposures and seams take, if frames are not kept for drawing.
const SEAMS_SHARE: f64 = 0.65;
/// Share that putting a picture together from shards takes.
const PICTURE_JOIN_SHARE: f64 = 0.07;
/// Share that cutting 3D Tiles from shards takes.
const TILES_JOIN_SHARE: f64 = 0.4;
/// Processor time of a pixel of the panoramas that a report compares, seconds.
const TIME_PER_REPORT_PIXEL_S: f64 = 1.1e-6;
/// Memory of any report, bytes.
const REPORT_BYTES: u64 = 8 << 20;
/// Memory of a pixel of the panoramas that a report compares, and of their pictures, bytes.
const REPORT_BYTES_PER_PIXEL: u64 = 32;

/// The work on panoramas of a section.
#[derive(Clone, Copy, Debug, Default)]
pub struct PanoramaWork {
    /// Pixels of the panorama at the frames' resolution.
    pixels: u64,
    /// Memory of drawing it.
    memory: PlannedMemory,
    /// Memory of all frames, bytes.
    frames_bytes: u64,
}

impl PanoramaWork {
    /// The work on panoramas of a survey, by its initial poses, on so many threads.
    ///
    /// Frames that show no wall or cannot be read make no panorama: the task says so.
    pub fn of(survey: &Survey, threads: usize) -> Self {
        Self::laid_out(survey, threads).unwrap_or_default()
    }

    fn laid_out(survey: &Survey, threads: usize) -> Result<Self, RenderError> {
        let stitch = Stitch::new(
            survey.surface.as_ref(),
            &survey.cameras,
            &survey.frames,
            &survey.initial_poses(),
            &survey.shutter(),
            &StitchOptions::default(),
        )?;
        let (canvas, frames) = (stitch.canvas(), stitch.frames());
        let tiles_bytes = TilesTarget::bytes_for(canvas, frames.format())?;
        Ok(Self {
            pixels: canvas.pixels() as u64,
            memory: stitch.planned_memory(tiles_bytes, threads)?,
            frames_bytes: frames.frame_bytes() * frames.len() as u64,
        })
    }

    /// Processor time of a part of a step, seconds.
    pub fn seconds(&self, step: SectionStep, part: Part, shards: usize) -> f64 {
        let share = match (step, part) {
            (SectionStep::Report, _) => {
                return TIME_PER_REPORT_PIXEL_S * self.report_pixels() as f64;
            }
            (_, Part::Seams) => SEAMS_SHARE,
            (_, Part::Shard(shard)) => 1.0 / shard.of as f64,
            (SectionStep::Stitch, Part::Whole) if shards > 1 => PICTURE_JOIN_SHARE,
            (_, Part::Whole) if shards > 1 => TILES_JOIN_SHARE,
            (_, Part::Whole) => 1.0,
        };
        share * TIME_PER_PIXEL_S * self.pixels as f64
    }

    /// Memory of a part of a step beside that of the program, bytes.
    pub fn bytes(&self, step: SectionStep, part: Part, shards: usize) -> u64 {
        match (step, part) {
            (SectionStep::Report, _) => {
                let frames_bytes = self.frames_bytes.min(MAX_FRAME_BYTES);
                REPORT_BYTES + frames_bytes + REPORT_BYTES_PER_PIXEL * self.report_pixels()
            }
            (_, Part::Seams) => self.memory.seams,
            (_, Part::Shard(_)) => self.memory.shard,
            (_, Part::Whole) if shards > 1 => self.memory.join,
            (_, Part::Whole) => self.memory.whole,
        }
    }

    /// Pixels of a panorama in a report.
    fn report_pixels(&self) -> u64 {
        self.pixels.min(MAX_PIXELS as u64)
    }
}
