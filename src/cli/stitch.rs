//! `tunnelstitch stitch`: one panorama from given poses.

use super::outputs::{Keeping, OutputArguments};
use super::poses::PosesArgument;
use super::record::{self, Run};
use super::resume::{self, ResumeArguments};
use super::{Failure, Terminal, json};
use crate::frames::PictureFormat;
use crate::persist::atomic;
use crate::progress::Progress;
use crate::refine::read_covariances;
use crate::render::{
    Budget, FrameExposure, Gap, Interpolation, Layout, Mode, RenderOptions, Stitch, StitchOptions,
};
use crate::survey::Survey;
use crate::trajectory::poses_of;
use clap::ValueEnum;
use nalgebra::Matrix6;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Draws one panorama of the unrolled wall from given poses.
///
/// The poses are used as they are; `refine` makes them right. Interrupted or killed, the same
/// command goes on where it was.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  tunnelstitch stitch my-survey --poses refined/poses.tum --out after.png\n  tunnelstitch stitch my-survey --poses refined/poses.tum --px-per-metre 400 --out wall.tif --maps maps"
)]
pub struct StitchArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArgument,
    #[command(flatten)]
    output: OutputArguments,
    #[command(flatten)]
    picture: PictureArguments,
    #[command(flatten)]
    blend: BlendArguments,
    /// Memory to work with, as 512MiB or 2GiB. Frames that have no room are decoded again when they
    /// are needed.
    #[arg(long, value_name = "SIZE", default_value = "2GiB", value_parser = memory_size)]
    memory: u64,
    /// Treat every camera as standing on the tunnel's axis (to see what its position does).
    #[arg(long)]
    ignore_offset: bool,
    /// Print what was drawn as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    resume: ResumeArguments,
}

/// The canvas of panoramas.
#[derive(Debug, Default, clap::Args)]
pub struct CanvasArguments {
    /// Pixels per metre of wall [default: the frames' own resolution at the wall].
    #[arg(long, value_name = "N", value_parser = positive)]
    pub px_per_metre: Option<f64>,
    /// How the panorama lies in its file.
    #[arg(long, value_enum, default_value_t)]
    pub layout: LayoutArgument,
}

/// How panoramas are drawn.
#[derive(Debug, Default, clap::Args)]
pub struct PictureArguments {
    /// What they are drawn on.
    #[command(flatten)]
    pub canvas: CanvasArguments,
    /// How frames are sampled between their pixels.
    #[arg(long, value_enum, default_value_t)]
    pub interpolation: InterpolationArgument,
}

/// Which frames a panorama shows, and how they pass into each other.
#[derive(Debug, clap::Args)]
pub struct BlendArguments {
    /// Which frames a pixel shows.
    #[arg(long, value_enum, default_value_t)]
    pub mode: ModeArgument,
    /// Leave the frames' values as they are: undo no exposure, level out no light, blend nothing
    /// over seams. With --interpolation nearest every pixel is one of a frame, unchanged.
    #[arg(long)]
    pub no_blend: bool,
    /// Solve for the wall from all frames that show it, 2 times as fine as any of them. Needs poses
    /// good to some hundredths of a pixel (refine's), and takes microseconds per pixel and frame.
    #[arg(long, value_name = "2", value_parser = clap::value_parser!(u8).range(2..=2), conflicts_with_all = ["no_blend", "mode"])]
    pub super_resolve: Option<u8>,
}

/// Modes by name.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum ModeArgument {
    /// The frame that shows the wall best there; seams run where frames agree.
    #[default]
    BestView,
    /// The mean of all frames, weighted towards their middles: least noise.
    Average,
    /// The median of all frames: what most of them show.
    Median,
}

impl From<ModeArgument> for Mode {
    fn from(mode: ModeArgument) -> Self {
        match mode {
            ModeArgument::BestView => Self::BestView,
            ModeArgument::Average => Self::Average,
            ModeArgument::Median => Self::Median,
        }
    }
}

/// Layouts by name.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum LayoutArgument {
    /// Angle to the right, chainage down: the wall as seen from inside.
    #[default]
    ThetaRight,
    /// The same turned counter-clockwise: chainage to the right, angle up.
    ChainageRight,
}

impl From<LayoutArgument> for Layout {
    fn from(layout: LayoutArgument) -> Self {
        match layout {
            LayoutArgument::ThetaRight => Self::ThetaRight,
            LayoutArgument::ChainageRight => Self::ChainageRight,
        }
    }
}

/// Interpolations by name.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum InterpolationArgument {
    /// Catmull-Rom: sharp.
    #[default]
    Bicubic,
    /// Softer and faster.
    Bilinear,
    /// Three lobes: sharpest, slower, rings a little beside edges.
    #[value(name = "lanczos3")]
    Lanczos3,
    /// The nearest pixel, unchanged.
    Nearest,
}

impl From<InterpolationArgument> for Interpolation {
    fn from(interpolation: InterpolationArgument) -> Self {
        match interpolation {
            InterpolationArgument::Bicubic => Self::Bicubic,
            InterpolationArgument::Bilinear => Self::Bilinear,
            InterpolationArgument::Lanczos3 => Self::Lanczos3,
            InterpolationArgument::Nearest => Self::Nearest,
        }
    }
}

/// A size of memory in bytes, for clap.
pub fn memory_size(text: &str) -> Result<u64, String> {
    const FORM: &str = "must be a size as 512MiB or 2GiB";
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "mib" | "m" => 1u64 << 20,
        "gib" | "g" => 1 << 30,
        _ => return Err(FORM.to_owned()),
    };
    match digits.trim().parse::<f64>() {
        Ok(size) if size.is_finite() && size > 0.0 => Ok((size * unit as f64) as u64),
        _ => Err(FORM.to_owned()),
    }
}

/// A number above zero, for clap.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("must be a positive number".to_owned()),
    }
}

#[derive(Serialize)]
struct Report<'a> {
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

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output.
pub fn run(arguments: &StitchArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    arguments.output.check()?;
    let (survey, trajectory) = arguments.poses.open(&arguments.survey, terminal)?;
    let poses = poses_of(&trajectory);
    arguments.output.check_apart(&survey)?;
    let covariances = covariances(arguments, &survey)?;
    let options = StitchOptions {
        px_per_metre: arguments.picture.canvas.px_per_metre,
        ignore_offset: arguments.ignore_offset,
        render: RenderOptions {
            interpolation: arguments.picture.interpolation.into(),
            mode: arguments.blend.mode.into(),
            blend: !arguments.blend.no_blend,
            super_resolve: arguments.blend.super_resolve.is_some(),
        },
        memory: arguments.memory,
    };
    let surface = survey.surface.as_ref();
    let layout: Layout = arguments.picture.canvas.layout.into();
    let shutter = survey.shutter();
    let mut stitch = Stitch::new(
        surface,
        &survey.camera,
        &survey.frames,
        &poses,
        &shutter,
        &options,
    )?;
    let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
    let [width, height] = layout.size(&canvas);
    let budget = stitch.budget(arguments.output.bytes(&canvas, format, layout))?;
    let frames_bytes = stitch.frames().frame_bytes() * survey.frames.len() as u64;
    let say = |text: String| {
        if !arguments.json {
            terminal.say(text);
        }
    };
    say(format!(
        "{width} × {height} px; at most {} MiB of memory, {} of them for frames",
        budget.most(frames_bytes) >> 20,
        frames_bytes.min(budget.room) >> 20
    ));
    let inputs = record::inputs(&survey, arguments.poses.file())?;
    let origin = resume::origin(&survey, &arguments.result(&options), inputs.clone())?;
    let out = &arguments.output.out;
    let resume = &arguments.resume;
    resume.run(out, &origin, |text| say(text.to_owned()), |checkpoint| {
        let mut outputs = arguments
            .output
            .begin(&canvas, format, layout, checkpoint)?;
        let settled = match checkpoint.state(SETTLED)? {
            Some(settled) => settled,
            None => {
                let settled = stitch.settle(&budget, terminal)?;
                checkpoint.keep(SETTLED, &settled)?;
                settled
            }
        };
        let (plan, frames) = stitch.plan(settled);
        let first = outputs.bands();
        let mut keeping = Keeping {
            outputs: &mut outputs,
            checkpoint,
        };
        plan.draw_from(first, frames, budget.room, &mut [&mut keeping], terminal)?;
        let coverage = outputs.share();
        if coverage == 0.0 {
            return Err(Failure::input(
                "no frame covers a single pixel of the panorama; check the calibration (cx, cy) and --px-per-metre",
            ));
        }
        let gaps = outputs.gaps(surface);
        terminal.start("writing", 1);
        let written = outputs.finish(&plan, &gaps, &survey.camera, covariances.as_deref());
        terminal.finish();
        written?;
        run.write(&arguments.output.run_file(), &inputs)?;
        let report = Report {
            out,
            width,
            height,
            px_per_metre: canvas.px_per_metre,
            layout,
            chainage_m: canvas.chainage_m(),
            coverage,
            gaps,
            frames: survey.frames.len(),
            render: options.render,
            exposure: plan.exposure().frames(),
            memory: budget,
        };
        if arguments.json { json::print(&report) } else {
            summarise(&report, terminal);
            Ok(())
        }
    })
}

/// Name of the state of what is settled before the first tile is drawn.
const SETTLED: &str = "settled";

impl StitchArguments {
    /// Everything that the result depends on, but the survey.
    fn result(&self, options: &StitchOptions) -> impl Serialize {
        (
            options.px_per_metre,
            options.ignore_offset,
            options.render,
            Layout::from(self.picture.canvas.layout),
            format!("{:?}", self.output),
        )
    }
}

/// Prints what was drawn.
fn summarise(report: &Report, terminal: &Terminal) {
    let say = |text: String| terminal.say(text);
    let [from_m, to_m] = report.chainage_m;
    let &Report {
        width,
        height,
        coverage,
        ..
    } = report;
    say(format!(
        "{}: {width} × {height} px, {:.2} px per metre, chainage {from_m:.3} to {to_m:.3} m, {:.1} % covered by {} frames",
        report.out.display(),
        report.px_per_metre,
        100.0 * coverage,
        report.frames
    ));
    let inner: Vec<&Gap> = report.gaps.iter().filter(|gap| !gap.at_the_end).collect();
    for gap in inner.iter().take(SHOWN_GAPS) {
        say(format!(
            "  nothing seen at chainage {:.3} to {:.3} m, {:.1}° to {:.1}° ({:.4} m²)",
            gap.chainage_from_m,
            gap.chainage_to_m,
            gap.angle_from_deg,
            gap.angle_to_deg,
            gap.area_m2
        ));
    }
    if inner.len() > SHOWN_GAPS {
        say(format!(
            "  and {} gaps more; --maps lists all of them",
            inner.len() - SHOWN_GAPS
        ));
    }
}

/// Gaps that the summary lists.
const SHOWN_GAPS: usize = 5;

/// The covariances of the poses: those asked for, or those beside the poses.
fn covariances(
    arguments: &StitchArguments,
    survey: &Survey,
) -> Result<Option<Vec<Matrix6<f64>>>, Failure> {
    if !arguments.output.wants_maps() {
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

/// The format of a picture to be written; its folder is made if missing. Checked before any work is
/// done.
///
/// # Errors
/// A name that says no format or belongs to a folder; a folder that cannot be made.
pub fn picture_output(path: &Path) -> Result<PictureFormat, Failure> {
    let format = PictureFormat::of(path).map_err(|error| Failure::usage(error.to_string()))?;
    if path.is_dir() {
        return Err(Failure::usage(format!(
            "{}: is a folder; name a file",
            path.display()
        )));
    }
    parent_folder(path)?;
    Ok(format)
}

/// Makes the folder of a file to be written, if it is missing.
///
/// # Errors
/// Whatever the system says.
pub fn parent_folder(path: &Path) -> Result<(), Failure> {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => Ok(atomic::create_folder(folder)?),
        _ => Ok(()),
    }
}
