//! `tunnelstitch stitch`: draws one panorama from given poses.

use crate::cli::arguments::{
    BlendArguments, OutputArguments, PictureArguments, PosesArguments, ResumeArguments,
    memory_size, resume,
};
use crate::cli::commands::overlay::leave_out_overlay;
use crate::cli::output::{DryRunArguments, Failure, Job, RunRecord, Terminal, json, record};
use crate::evaluate::deformation::DeviationMap;
use crate::files::printed;
use crate::persist::atomic::OutputSet;
use crate::persist::checkpoint::Checkpoint;
use crate::persist::provenance::Input;
use crate::progress::Progress;
use crate::refine::read_covariances;
use crate::render::{
    Budget, CheckpointedFiles, DeformationAt, FrameExposure, Gap, Layout, MaskedAt, PanoramaFiles,
    PanoramaJob, Plan, RenderOptions, Stitch, StitchOptions, WallProperties,
};
use crate::surface::WallPoint;
use crate::survey::{MaskedWall, Survey};
use crate::trajectory::poses_of;
use nalgebra::Matrix6;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Draws one panorama of the unrolled wall from given poses.
///
/// The poses are used as they are; `refine` improves them. If the run is interrupted, the same
/// command continues it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch stitch my-survey --poses refined/poses.tum --out after.png\n  \
    tunnelstitch stitch my-survey --poses refined/poses.tum --px-per-metre 400 --out wall.tif \
    --maps maps")]
pub struct StitchArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArguments,
    #[command(flatten)]
    output: OutputArguments,
    #[command(flatten)]
    picture: PictureArguments,
    #[command(flatten)]
    blend: BlendArguments,
    /// Memory limit, as 512MiB or 2GiB. Frames that do not fit are decoded again when they are
    /// needed.
    #[arg(long, value_name = "SIZE", default_value = "2GiB", value_parser = memory_size)]
    memory: u64,
    /// Treat every camera as if it stood on the tunnel's axis, to see the effect of its position.
    #[arg(long)]
    ignore_offset: bool,
    #[command(flatten)]
    resume: ResumeArguments,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Description of a panorama.
#[derive(Serialize)]
struct StitchReport<'a> {
    out: &'a Path,
    width: u32,
    height: u32,
    px_per_metre: f64,
    layout: Layout,
    chainage_m: [f64; 2],
    coverage: f64,
    gaps: Vec<Gap>,
    frames: usize,
    render: RenderOptions,
    exposure: &'a [FrameExposure],
    memory: Budget,
}

/// Largest number of gaps that the summary lists.
const MAX_LISTED_GAPS: usize = 5;

/// Name of the checkpointed exposures and seams, which are computed before the first band.
const SETTLED: &str = "settled";

/// Inputs of a run after all checks.
struct StitchRun<'a> {
    arguments: &'a StitchArguments,
    survey: &'a Survey,
    options: StitchOptions,
    layout: Layout,
    covariances: Option<Vec<Matrix6<f64>>>,
    deformation: Option<DeviationMap>,
    masked: Option<MaskedWall>,
    record: &'a RunRecord,
    terminal: &'a Terminal,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output.
pub fn run(
    arguments: &StitchArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let output = &arguments.output;
    output.check_names()?;
    let (mut survey, trajectory) = arguments.poses.open(&arguments.survey, terminal)?;
    output.check_overwriting(&survey)?;
    leave_out_overlay(&mut survey, terminal)?;
    let run = StitchRun {
        arguments,
        survey: &survey,
        options: arguments.options(),
        layout: arguments.picture.canvas.layout.into(),
        covariances: read_pose_covariances(arguments, &survey)?,
        deformation: if output.has_maps() {
            DeviationMap::of_survey(&survey)?
        } else {
            None
        },
        masked: read_masked_wall(arguments, &survey)?,
        record,
        terminal,
    };
    let mut stitch = Stitch::new(
        survey.surface.as_ref(),
        &survey.cameras,
        &survey.frames,
        &poses_of(&trajectory),
        &survey.shutter(),
        &run.options,
    )?;
    let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
    let files = output.options();
    let budget = stitch.budget(files.pending_bytes(&canvas, format, run.layout))?;
    output.check_formats(&canvas, format, run.layout)?;
    if arguments.dry_run.is_set() {
        return run.job(&stitch, &budget).print(terminal);
    }
    run.announce(&stitch, &budget);
    let inputs = record::hash_survey(&survey, arguments.poses.file())?;
    let origin = resume::origin(&survey, &run.options_of_result(), inputs.clone())?;
    let say = |text: &str| terminal.say(text);
    arguments
        .resume
        .run(&output.out, &origin, say, |checkpoint| {
            for also in [&files.dzi, &files.maps].into_iter().flatten() {
                checkpoint.lock_also(also)?;
            }
            run.draw(&mut stitch, budget, checkpoint, &inputs)
        })
}

impl StitchArguments {
    /// Options of the renderer.
    fn options(&self) -> StitchOptions {
        StitchOptions {
            px_per_metre: self.picture.canvas.px_per_metre,
            ignore_offset: self.ignore_offset,
            render: self.blend.render_options(self.picture.interpolation.into()),
            memory: self.memory,
        }
    }
}

impl StitchRun<'_> {
    /// Prints the size of the panorama and the memory that it takes.
    fn announce(&self, stitch: &Stitch, budget: &Budget) {
        let [width, height] = self.layout.size(stitch.canvas());
        let frames_bytes = self.frames_bytes(stitch);
        self.terminal.say(format!(
            "{width} × {height} px; at most {} MiB of memory, {} of them for frames",
            budget.most(frames_bytes) >> 20,
            frames_bytes.min(budget.room) >> 20
        ));
    }

    /// Memory of all frames together, bytes.
    fn frames_bytes(&self, stitch: &Stitch) -> u64 {
        stitch.frames().frame_bytes() * self.survey.frames.len() as u64
    }

    /// The work, for `--dry-run`.
    fn job(&self, stitch: &Stitch, budget: &Budget) -> Job {
        Job {
            writes: self.arguments.output.paths(),
            panorama_px: Some(self.layout.size(stitch.canvas())),
            memory_bytes: Some(budget.most(self.frames_bytes(stitch))),
            ..Job::of(self.survey, self.arguments.poses.file())
        }
    }

    /// Everything that the result depends on, except the survey.
    fn options_of_result(&self) -> impl Serialize {
        let options = &self.options;
        (
            options.px_per_metre,
            options.ignore_offset,
            options.render,
            self.layout,
            format!("{:?}", self.arguments.output),
        )
    }

    /// Draws the panorama into its files and prints the summary.
    fn draw(
        &self,
        stitch: &mut Stitch,
        budget: Budget,
        checkpoint: &mut Checkpoint,
        inputs: &[Input],
    ) -> Result<(), Failure> {
        let terminal = self.terminal;
        let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
        let output = &self.arguments.output;
        let mut files = output
            .options()
            .begin(&canvas, format, self.layout, checkpoint)?;
        let progress = PanoramaJob::new(terminal, 1).panorama(0);
        let settled = match checkpoint.state(SETTLED)? {
            Some(settled) => settled,
            None => {
                let settled = stitch.settle(&budget, &progress)?;
                checkpoint.keep(SETTLED, &settled)?;
                settled
            }
        };
        let (plan, frames) = stitch.plan(settled);
        let first_band = files.bands();
        let mut target = CheckpointedFiles {
            files: &mut files,
            checkpoint,
        };
        plan.draw_from(
            first_band,
            frames,
            budget.room,
            &mut [&mut target],
            &progress,
        )?;
        drop(progress);
        let coverage = files.coverage();
        if coverage == 0.0 {
            return Err(Failure::input(
                "no frame covers a single pixel of the panorama; check the calibration (cx, cy) \
                 and --px-per-metre",
            ));
        }
        let gaps = files.gaps(self.survey.surface.as_ref());
        terminal.start("writing", 1);
        let staged = self.stage_files(files, &plan, &gaps);
        terminal.finish();
        let mut outputs = staged?;
        (self.record).add_to(&mut outputs, &output.run_file(), inputs)?;
        outputs.commit()?;
        let [width, height] = self.layout.size(&canvas);
        let report = StitchReport {
            out: &output.out,
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
            memory: budget,
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
        let deformation = self.deformation.as_ref();
        let deformation_at = deformation.map(|map| |wall: WallPoint| map.at_mm(wall));
        let masked = self.masked.as_ref();
        let masked_at = masked.map(|masked| {
            |wall: WallPoint| masked.share_at(wall).map_or(f32::NAN, |share| share as f32)
        });
        let wall = WallProperties {
            deformation: deformation_at.as_ref().map(|at| at as &DeformationAt),
            masked: masked_at.as_ref().map(|at| at as &MaskedAt),
        };
        let covariances = self.covariances.as_deref();
        let mut outputs = OutputSet::default();
        files.finish(
            &mut outputs,
            plan,
            gaps,
            &self.survey.cameras,
            covariances,
            wall,
        )?;
        Ok(outputs)
    }
}

/// Prints size, coverage and gaps of the panorama.
fn print_summary(report: &StitchReport, terminal: &Terminal) {
    let say = |text: String| terminal.say(text);
    let [from_m, to_m] = report.chainage_m;
    say(format!(
        "{}: {} × {} px, {:.2} px per metre, chainage {from_m:.3} to {to_m:.3} m, {:.1} % covered \
         by {} frames",
        printed(report.out),
        report.width,
        report.height,
        report.px_per_metre,
        100.0 * report.coverage,
        report.frames
    ));
    let inner: Vec<&Gap> = report.gaps.iter().filter(|gap| !gap.at_the_end).collect();
    for gap in inner.iter().take(MAX_LISTED_GAPS) {
        say(format!(
            "  not covered: chainage {:.3} to {:.3} m, {:.1}° to {:.1}° ({:.4} m²)",
            gap.chainage_from_m,
            gap.chainage_to_m,
            gap.angle_from_deg,
            gap.angle_to_deg,
            gap.area_m2
        ));
    }
    if inner.len() > MAX_LISTED_GAPS {
        say(format!(
            "  and {} more gaps; --maps lists all of them",
            inner.len() - MAX_LISTED_GAPS
        ));
    }
}

/// Reads the wall that `refine` has left out and written beside the poses, for its map; None if it
/// is not there.
///
/// # Errors
/// A malformed file, or one of another tunnel.
fn read_masked_wall(
    arguments: &StitchArguments,
    survey: &Survey,
) -> Result<Option<MaskedWall>, Failure> {
    let poses = arguments.poses.file();
    match poses.filter(|_| arguments.output.has_maps()) {
        Some(poses) => Ok(MaskedWall::read_beside(
            poses,
            survey.nominal.perimeter_m(),
        )?),
        None => Ok(None),
    }
}

/// Reads the covariances of the poses for the map of uncertainty: those of --covariance, else those
/// beside the poses.
///
/// # Errors
/// A malformed file, or one of another survey.
fn read_pose_covariances(
    arguments: &StitchArguments,
    survey: &Survey,
) -> Result<Option<Vec<Matrix6<f64>>>, Failure> {
    if !arguments.output.has_maps() {
        return Ok(None);
    }
    let beside = arguments
        .poses
        .file()
        .map(|file| file.with_file_name("covariance.csv"));
    let path = match &arguments.output.covariance {
        Some(path) => Some(path.clone()),
        None => beside.filter(|path| path.is_file()),
    };
    match path {
        Some(path) => Ok(Some(read_covariances(&path, survey.frames.len())?)),
        None => Ok(None),
    }
}
