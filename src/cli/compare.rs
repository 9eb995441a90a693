//! `tunnelstitch compare`: initial against refined poses.

use super::poses::ReadingArguments;
use super::record::{self, RUN_FILE, Run};
use super::stitch::{PictureArguments, positive};
use super::{Failure, Terminal, json};
use crate::PROGRAM;
use crate::evaluate::{CompareInput, ComparedPanoramas, Comparison, compare, draw_before_after};
use crate::frames::{PictureFormat, write_picture};
use crate::persist::atomic;
use crate::progress::Progress;
use crate::render::{Interpolation, Layout, Mode, RenderOptions};
use crate::survey::Survey;
use crate::trajectory::{Pose, poses_of};
use image::DynamicImage;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Compares the survey's initial poses with refined ones, and both with the true ones where known.
///
/// Writes baseline.png, refined.png, truth.png (all of the same stretch of wall), before-after.png
/// (a small extract of the first above the second) and compare.json.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  tunnelstitch compare my-survey --refined refined/poses.tum --out compared"
)]
pub struct CompareArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// The refined poses, in the tunnel's frame as `refine` and `convert` write them, in any
    /// format. The flags for reading poses are about those of the survey; `convert` first what has
    /// another convention.
    #[arg(long, value_name = "FILE")]
    refined: PathBuf,
    /// Folder for the results; made if need be.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    picture: PictureArguments,
    /// Print compare.json on standard output instead of the table.
    #[arg(long)]
    json: bool,
    /// Exit with code 4 if the refined poses put pixels farther than this from their true place on
    /// the wall (root mean square, pixels). Needs true poses.
    #[arg(long, value_name = "X", value_parser = positive)]
    max_wall_px: Option<f64>,
    #[command(flatten)]
    reading: ReadingArguments,
}

/// `compare.json`.
#[derive(Serialize)]
struct Report<'a> {
    program: &'static str,
    survey: &'a Path,
    refined_poses: &'a Path,
    layout: Layout,
    #[serde(flatten)]
    comparison: &'a Comparison,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output, and for a quality
/// gate that is not met (after everything was written).
pub fn run(arguments: &CompareArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    let survey = arguments.reading.open(&arguments.survey, terminal)?;
    if arguments.max_wall_px.is_some() && survey.truth.is_none() {
        return Err(Failure::usage(
            "--max-wall-px needs true poses, and the survey has no poses.truth",
        ));
    }
    let refined = poses_of(&survey.read_poses(&arguments.refined)?);
    atomic::create_folder(&arguments.out)?;
    let (comparison, drawings) = compare_poses(
        &survey,
        &refined,
        arguments.picture.canvas.px_per_metre,
        arguments.picture.interpolation.into(),
        terminal,
    )?;
    let json = write_comparison(
        &survey,
        &arguments.refined,
        arguments.picture.canvas.layout.into(),
        &comparison,
        drawings,
        &arguments.out,
        terminal,
    )?;
    let inputs = record::inputs(&survey, [arguments.refined.as_path()])?;
    run.write(&arguments.out.join(RUN_FILE), &inputs)?;
    if arguments.json {
        json::print_text(&json)?;
    } else {
        terminal.say(comparison.to_string());
        terminal.say(format!("wrote {}", arguments.out.display()));
    }
    gate(&comparison, arguments.max_wall_px)
}

/// Compares a survey's initial with refined poses, and both with the true ones where they are
/// known.
///
/// # Errors
/// Poses that cannot be laid on the wall, unreadable frames, too little memory.
pub fn compare_poses(
    survey: &Survey,
    refined: &[Pose],
    px_per_metre: Option<f64>,
    interpolation: Interpolation,
    terminal: &Terminal,
) -> Result<(Comparison, ComparedPanoramas), Failure> {
    let initial = survey.initial_poses();
    let truth = survey.truth.as_deref().map(poses_of);
    let input = CompareInput {
        surface: survey.surface.as_ref(),
        camera: &survey.camera,
        shutter: &survey.shutter(),
        files: &survey.frames,
        initial: &initial,
        refined,
        truth: truth.as_deref(),
        px_per_metre,
        // Pictures of different poses differ by their poses only.
        render: RenderOptions {
            interpolation,
            mode: Mode::Average,
            blend: false,
            super_resolve: false,
        },
    };
    Ok(compare(&input, terminal)?)
}

/// Writes the panoramas and compare.json into `out`; returns the text of the latter too.
///
/// # Errors
/// An output that cannot be written.
pub fn write_comparison(
    survey: &Survey,
    refined_file: &Path,
    layout: Layout,
    comparison: &Comparison,
    drawings: ComparedPanoramas,
    out: &Path,
    terminal: &Terminal,
) -> Result<String, Failure> {
    let json = json::text(&Report {
        program: PROGRAM,
        survey: &survey.folder,
        refined_poses: refined_file,
        layout,
        comparison,
    })?;
    terminal.start("writing", 4);
    let write = |name: &str, image: &DynamicImage| -> Result<(), Failure> {
        write_picture(&out.join(name), image, PictureFormat::Png)?;
        terminal.advance(1);
        Ok(())
    };
    let baseline = drawings.baseline.panorama.into_image(Layout::ThetaRight);
    let refined = drawings.refined.panorama.into_image(Layout::ThetaRight);
    write(
        "before-after.png",
        &draw_before_after(&baseline, &refined).into(),
    )?;
    write("baseline.png", &layout.turn(baseline))?;
    write("refined.png", &layout.turn(refined))?;
    match drawings.truth {
        Some(truth) => write("truth.png", &truth.panorama.into_image(layout))?,
        // One from an earlier comparison would belong to other pictures.
        None => atomic::remove_file(&out.join("truth.png"))?,
    }
    terminal.finish();
    atomic::write_text(&out.join("compare.json"), &json)?;
    Ok(json)
}

/// Fails if the refined wall error is above the limit.
fn gate(comparison: &Comparison, max_wall_px: Option<f64>) -> Result<(), Failure> {
    match (max_wall_px, &comparison.refined.wall) {
        (Some(limit), Some(wall)) if wall.px.rms > limit => Err(Failure::quality(format!(
            "the refined poses are {:.4} px off on the wall (root mean square), more than --max-wall-px {limit}",
            wall.px.rms
        ))),
        _ => Ok(()),
    }
}
