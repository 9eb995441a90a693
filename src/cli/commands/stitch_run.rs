//! Drawing of a whole panorama into its files.

use crate::cli::arguments::OutputArguments;
use crate::cli::commands::stitch_maps::MapInputs;
use crate::cli::commands::stitch_summary::{StitchReport, print_summary};
use crate::cli::output::{Failure, Job, RunRecord, Terminal, json};
use crate::persist::atomic::OutputSet;
use crate::persist::checkpoint::Checkpoint;
use crate::persist::provenance::Input;
use crate::progress::Progress;
use crate::render::{
    Budget, CheckpointedFiles, DeformationAt, Gap, Layout, MaskedAt, PanoramaFileOptions,
    PanoramaFiles, PanoramaJob, Plan, Stitch, StitchOptions, WallProperties,
};
use crate::surface::WallPoint;
use crate::survey::Survey;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Name of the checkpointed exposures and seams, which are computed before the first band.
const SETTLED: &str = "settled";

/// Inputs of a run after all checks.
pub struct StitchRun<'a> {
    /// Its files, as they are asked for.
    pub output: &'a OutputArguments,
    /// Their names and formats.
    pub files: PanoramaFileOptions,
    /// File of the poses, if they are not the survey's own.
    pub poses: Option<&'a Path>,
    /// The survey.
    pub survey: &'a Survey,
    /// Options of the renderer.
    pub options: StitchOptions,
    /// Direction of the axes.
    pub layout: Layout,
    /// Memory, bytes.
    pub budget: Budget,
    /// Files of `refine` for the maps.
    pub map_inputs: MapInputs,
    /// Record of the run.
    pub record: &'a RunRecord,
    /// Receiver of messages and progress.
    pub terminal: &'a Terminal,
}

impl StitchRun<'_> {
    /// Prints the size of the panorama and the memory that it takes.
    pub fn announce(&self, stitch: &Stitch) {
        let [width, height] = self.layout.size(stitch.canvas());
        let frames_bytes = self.frames_bytes(stitch);
        self.terminal.say(format!(
            "{width} × {height} px; at most {} MiB of memory, {} of them for frames",
            self.budget.most(frames_bytes) >> 20,
            frames_bytes.min(self.budget.room) >> 20
        ));
    }

    /// Memory of all frames together, bytes.
    fn frames_bytes(&self, stitch: &Stitch) -> u64 {
        stitch.frames().frame_bytes() * self.survey.frames.len() as u64
    }

    /// The work, for `--dry-run`; of a part of the panorama if there is one.
    pub fn job(&self, stitch: &Stitch, part: Option<PathBuf>) -> Job {
        Job {
            writes: part.map_or_else(|| self.output.paths(), |part| vec![part]),
            panorama_px: Some(self.layout.size(stitch.canvas())),
            memory_bytes: Some(self.budget.most(self.frames_bytes(stitch))),
            ..Job::of(self.survey, self.poses)
        }
    }

    /// Everything that the result depends on, except the survey.
    pub fn options_of_result(&self) -> impl Serialize {
        (self.options_of_parts(), format!("{:?}", self.output))
    }

    /// Everything that parts of the result depend on, except the survey.
    pub fn options_of_parts(&self) -> impl Serialize {
        let (options, files) = (&self.options, &self.files);
        let encoding = (files.compression, files.quality, files.maps.is_some());
        (
            options.px_per_metre,
            options.ignore_offset,
            options.render,
            self.layout,
            format!("{encoding:?}"),
        )
    }

    /// Begins the files, or continues them from the state that a checkpoint keeps.
    ///
    /// # Errors
    /// As [`PanoramaFileOptions::begin`].
    pub fn begin_files(
        &self,
        stitch: &Stitch,
        checkpoint: &mut Checkpoint,
    ) -> Result<PanoramaFiles, Failure> {
        let (canvas, format) = (stitch.canvas(), stitch.frames().format());
        let files = self.files.begin(canvas, format, self.layout, checkpoint);
        Ok(files?)
    }

    /// Draws the panorama into its files and prints the summary.
    ///
    /// # Errors
    /// A frame that cannot be decoded; an output that cannot be written.
    pub fn draw(
        &self,
        stitch: &mut Stitch,
        checkpoint: &mut Checkpoint,
        inputs: &[Input],
    ) -> Result<(), Failure> {
        let mut files = self.begin_files(stitch, checkpoint)?;
        let progress = PanoramaJob::new(self.terminal, 1).panorama(0);
        let settled = match checkpoint.state(SETTLED)? {
            Some(settled) => settled,
            None => {
                let settled = stitch.settle(&self.budget, &progress)?;
                checkpoint.keep(SETTLED, &settled)?;
                settled
            }
        };
        let (plan, frames) = stitch.plan(settled);
        let bands = files.bands()..plan.bands();
        let mut target = CheckpointedFiles {
            files: &mut files,
            checkpoint,
        };
        let room = self.budget.room;
        plan.draw_bands(bands, frames, room, &mut [&mut target], &progress)?;
        drop(progress);
        self.finish(files, &plan, inputs)
    }

    /// Completes the files of a panorama all bands of which are drawn, and prints the summary.
    ///
    /// # Errors
    /// No frame shows the wall; an output that cannot be written.
    pub fn finish(
        &self,
        files: PanoramaFiles,
        plan: &Plan,
        inputs: &[Input],
    ) -> Result<(), Failure> {
        let (terminal, canvas) = (self.terminal, plan.canvas());
        let coverage = files.coverage();
        if coverage == 0.0 {
            return Err(Failure::input(
                "no frame covers a single pixel of the panorama, by the calibration (cx, cy) and \
                 --px-per-metre",
            ));
        }
        let gaps = files.gaps(self.survey.surface.as_ref());
        terminal.start("writing", 1);
        let staged = self.stage_files(files, plan, &gaps);
        terminal.finish();
        let mut outputs = staged?;
        (self.record).add_to(&mut outputs, &self.output.run_file(), inputs)?;
        outputs.commit()?;
        let [width, height] = self.layout.size(canvas);
        let report = StitchReport {
            out: &self.output.out,
            width,
            height,
            px_per_metre: canvas.px_per_metre,
            layout: self.layout,
            chainage_m: canvas.chainage_m(),
            coverage,
            gaps,
            frames: self.survey.frames.len(),
            render: self.options.render,
            exposure: plan.exposure().frames(),
            memory: self.budget,
        };
        if terminal.is_json() {
            json::print(&report)
        } else {
            print_summary(&report, terminal);
            Ok(())
        }
    }

    /// Completes the files of the panorama; they have not their names yet.
    fn stage_files(
        &self,
        files: PanoramaFiles,
        plan: &Plan,
        gaps: &[Gap],
    ) -> Result<OutputSet, Failure> {
        let MapInputs {
            covariances,
            deformation,
            masked,
        } = &self.map_inputs;
        let deformation = deformation.as_ref();
        let deformation_at = deformation.map(|map| |wall: WallPoint| map.at_mm(wall));
        let masked = masked.as_ref();
        let masked_at = masked.map(|masked| {
            |wall: WallPoint| masked.share_at(wall).map_or(f32::NAN, |share| share as f32)
        });
        let wall = WallProperties {
            deformation: deformation_at.as_ref().map(|at| at as &DeformationAt),
            masked: masked_at.as_ref().map(|at| at as &MaskedAt),
        };
        let mut outputs = OutputSet::default();
        files.finish(
            &mut outputs,
            plan,
            gaps,
            &self.survey.cameras,
            covariances.as_deref(),
            wall,
        )?;
        Ok(outputs)
    }
}
