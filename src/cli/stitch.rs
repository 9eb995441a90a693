//! `tunnelstitch stitch`: one panorama from given poses.

use super::{Failure, Terminal, json};
use crate::atomic;
use crate::frames::{PictureFormat, write_picture};
use crate::progress::Progress;
use crate::render::{Interpolation, Layout, Mode, RenderOptions, StitchOptions, stitch};
use crate::survey::Survey;
use crate::trajectory::{Pose, poses_of};
use clap::ValueEnum;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Draws one panorama of the unrolled wall from given poses.
///
/// The poses are used as they are; `refine` makes them right.
#[derive(Debug, clap::Args)]
pub struct StitchArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArgument,
    /// The panorama, .png or .tif.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    picture: PictureArguments,
    #[command(flatten)]
    blend: BlendArguments,
    /// Treat every camera as standing on the tunnel's axis (to see what its position does).
    #[arg(long)]
    ignore_offset: bool,
    /// Print what was drawn as JSON.
    #[arg(long)]
    json: bool,
}

/// Which poses.
#[derive(Debug, clap::Args)]
pub struct PosesArgument {
    /// Which poses: `initial` and `truth` are those of survey.toml, anything else is a TUM file.
    #[arg(
        id = "poses",
        long = "poses",
        default_value = "initial",
        value_name = "initial|truth|FILE"
    )]
    name: String,
}

impl PosesArgument {
    /// The poses that `initial`, `truth` or the name of a TUM file stand for.
    ///
    /// # Errors
    /// No true poses where they are asked for; a file that cannot be read or is no list of the frames' poses.
    pub fn of(&self, survey: &Survey) -> Result<Vec<Pose>, Failure> {
        match self.name.as_str() {
            "initial" => Ok(survey.initial_poses()),
            "truth" => match &survey.truth {
                Some(truth) => Ok(poses_of(truth)),
                None => Err(Failure::usage(
                    "--poses truth: the survey has no poses.truth; use --poses initial or a TUM file",
                )),
            },
            file => Ok(poses_of(&survey.read_poses(Path::new(file))?)),
        }
    }
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
    /// Leave the frames' values as they are: undo no exposure, level out no light, blend nothing over seams. With
    /// --interpolation nearest every pixel is one of a frame, unchanged.
    #[arg(long)]
    pub no_blend: bool,
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

/// A number above zero, for clap.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("must be a positive number".to_owned()),
    }
}

#[derive(Serialize)]
struct Report {
    out: PathBuf,
    width: u32,
    height: u32,
    px_per_metre: f64,
    layout: Layout,
    chainage_m: [f64; 2],
    coverage: f64,
    frames: usize,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output.
pub fn run(arguments: &StitchArguments, terminal: &Terminal) -> Result<(), Failure> {
    let format = picture_output(&arguments.out)?;
    let survey = Survey::open(&arguments.survey)?;
    let poses = arguments.poses.of(&survey)?;
    let options = StitchOptions {
        px_per_metre: arguments.picture.canvas.px_per_metre,
        ignore_offset: arguments.ignore_offset,
        render: RenderOptions {
            interpolation: arguments.picture.interpolation.into(),
            mode: arguments.blend.mode.into(),
            blend: !arguments.blend.no_blend,
        },
    };
    let panorama = stitch(
        survey.surface.as_ref(),
        &survey.camera,
        &survey.frames,
        &poses,
        &options,
        terminal,
    )?;
    let canvas = *panorama.canvas();
    let coverage = panorama.coverage();
    if coverage == 0.0 {
        return Err(Failure::input(
            "no frame covers a single pixel of the panorama; check the calibration (cx, cy) and --px-per-metre",
        ));
    }
    let layout = arguments.picture.canvas.layout.into();
    let image = panorama.into_image(layout);
    let report = Report {
        out: arguments.out.clone(),
        width: image.width(),
        height: image.height(),
        px_per_metre: canvas.px_per_metre,
        layout,
        chainage_m: canvas.chainage_m(),
        coverage,
        frames: survey.frames.len(),
    };
    terminal.start("writing", 1);
    let written = write_picture(&arguments.out, &image, format);
    terminal.finish();
    written?;
    if arguments.json {
        return json::print(&report);
    }
    terminal.say(format!(
        "{}: {} × {} px, {:.2} px per metre, chainage {:.3} to {:.3} m, {:.1} % covered by {} frames",
        arguments.out.display(),
        report.width,
        report.height,
        report.px_per_metre,
        report.chainage_m[0],
        report.chainage_m[1],
        100.0 * report.coverage,
        report.frames
    ));
    Ok(())
}

/// The format of a picture to be written; its folder is made if missing. Checked before any work is done.
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
    if let Some(folder) = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
    {
        atomic::create_folder(folder)?;
    }
    Ok(format)
}
