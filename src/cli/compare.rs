//! `tunnelstitch compare`: initial against refined poses.

use super::stitch::{PictureArguments, positive};
use super::{Failure, Terminal, json};
use crate::PROGRAM;
use crate::atomic;
use crate::evaluate::{CompareInput, Comparison, before_after, compare};
use crate::frames::{PictureFormat, write_picture};
use crate::progress::Progress;
use crate::render::{Layout, Mode, RenderOptions};
use crate::survey::Survey;
use crate::trajectory::poses_of;
use image::DynamicImage;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Compares the survey's initial poses with refined ones, and both with the true ones where known.
///
/// Writes baseline.png, refined.png, truth.png (all of the same stretch of wall), before-after.png (a small
/// extract of the first above the second) and compare.json.
#[derive(Debug, clap::Args)]
pub struct CompareArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// The refined poses, TUM.
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
    /// Exit with code 4 if the refined poses put pixels farther than this from their true place on the wall
    /// (root mean square, pixels). Needs true poses.
    #[arg(long, value_name = "X", value_parser = positive)]
    max_wall_px: Option<f64>,
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
/// [`Failure`] for everything wrong with the survey, the poses or the output, and for a quality gate that is
/// not met (after everything was written).
pub fn run(arguments: &CompareArguments, terminal: &Terminal) -> Result<(), Failure> {
    let survey = Survey::open(&arguments.survey)?;
    if arguments.max_wall_px.is_some() && survey.truth.is_none() {
        return Err(Failure::usage(
            "--max-wall-px needs true poses, and the survey has no poses.truth",
        ));
    }
    let (comparison, json) = compare_into(
        &survey,
        &arguments.refined,
        &arguments.picture,
        &arguments.out,
        terminal,
    )?;
    if arguments.json {
        json::print_text(&json)?;
    } else {
        terminal.say(comparison.to_string());
        terminal.say(format!("wrote {}", arguments.out.display()));
    }
    gate(&comparison, arguments.max_wall_px)
}

/// Compares and writes the panoramas and compare.json into `out`; returns the text of the latter too.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn compare_into(
    survey: &Survey,
    refined_file: &Path,
    picture: &PictureArguments,
    out: &Path,
    terminal: &Terminal,
) -> Result<(Comparison, String), Failure> {
    let (initial, refined) = (
        survey.initial_poses(),
        poses_of(&survey.read_poses(refined_file)?),
    );
    let truth = survey.truth.as_deref().map(poses_of);
    atomic::create_folder(out)?;
    let input = CompareInput {
        surface: survey.surface.as_ref(),
        camera: &survey.camera,
        shutter: &survey.shutter(),
        files: &survey.frames,
        initial: &initial,
        refined: &refined,
        truth: truth.as_deref(),
        px_per_metre: picture.canvas.px_per_metre,
        // Pictures of different poses differ by their poses only.
        render: RenderOptions {
            interpolation: picture.interpolation.into(),
            mode: Mode::Average,
            blend: false,
            super_resolve: false,
        },
    };
    let (comparison, panoramas) = compare(&input, terminal)?;
    let layout = picture.canvas.layout.into();
    let json = json::text(&Report {
        program: PROGRAM,
        survey: &survey.folder,
        refined_poses: refined_file,
        layout,
        comparison: &comparison,
    })?;
    terminal.start("writing", 4);
    let write = |name: &str, image: &DynamicImage| -> Result<(), Failure> {
        write_picture(&out.join(name), image, PictureFormat::Png)?;
        terminal.advance(1);
        Ok(())
    };
    let baseline = panoramas.baseline.into_image(Layout::ThetaRight);
    let refined = panoramas.refined.into_image(Layout::ThetaRight);
    write(
        "before-after.png",
        &before_after(&baseline, &refined).into(),
    )?;
    write("baseline.png", &layout.turn(baseline))?;
    write("refined.png", &layout.turn(refined))?;
    match panoramas.truth {
        Some(truth) => write("truth.png", &truth.into_image(layout))?,
        // One from an earlier comparison would belong to other pictures.
        None => atomic::remove_file(&out.join("truth.png"))?,
    }
    terminal.finish();
    atomic::write_text(&out.join("compare.json"), &json)?;
    Ok((comparison, json))
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
