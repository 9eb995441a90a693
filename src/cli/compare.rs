//! `tunnelstitch compare`: initial against refined poses.

use super::stitch::{PictureArguments, positive};
use super::{Failure, Terminal, json};
use crate::atomic;
use crate::evaluate::{CompareInput, Comparison, compare};
use crate::progress::Progress;
use crate::render::{Layout, Panorama, PictureFormat, write_picture};
use crate::survey::Survey;
use crate::trajectory::Pose;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Compares the survey's initial poses with refined ones, and both with the true ones where known.
///
/// Writes baseline.png, refined.png, truth.png (all of the same stretch of wall) and compare.json.
#[derive(Debug, clap::Args)]
pub struct CompareArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// The refined poses, TUM.
    #[arg(long, value_name = "FILE")]
    refined: PathBuf,
    /// Folder for the results; made if need be.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    picture: PictureArguments,
    /// Print compare.json too.
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
    let refined = survey.read_poses(&arguments.refined)?;
    let only_poses = |trajectory: &crate::trajectory::Trajectory| -> Vec<Pose> {
        trajectory.iter().map(|stamped| stamped.pose).collect()
    };
    let (initial, refined) = (survey.initial_poses(), only_poses(&refined));
    let truth = survey.truth.as_ref().map(only_poses);
    atomic::create_folder(&arguments.out)?;
    let input = CompareInput {
        surface: survey.surface.as_ref(),
        camera: &survey.camera,
        files: &survey.frames,
        initial: &initial,
        refined: &refined,
        truth: truth.as_deref(),
        px_per_metre: arguments.picture.px_per_metre,
        interpolation: arguments.picture.interpolation.into(),
    };
    let (comparison, panoramas) = compare(&input, terminal)?;
    let layout = arguments.picture.layout.into();
    let report = json::text(&Report {
        survey: &arguments.survey,
        refined_poses: &arguments.refined,
        layout,
        comparison: &comparison,
    })?;
    let pictures = [
        ("baseline.png", Some(panoramas.baseline)),
        ("refined.png", Some(panoramas.refined)),
        ("truth.png", panoramas.truth),
    ];
    terminal.start("writing", pictures.len());
    for (name, panorama) in pictures {
        if let Some(panorama) = panorama {
            write(&arguments.out.join(name), panorama, layout)?;
        }
        terminal.advance(1);
    }
    terminal.finish();
    atomic::write_text(&arguments.out.join("compare.json"), &report)?;
    if arguments.json {
        json::print_text(&report)?;
    } else {
        terminal.say(comparison.to_string());
    }
    gate(&comparison, arguments.max_wall_px)
}

fn write(path: &Path, panorama: Panorama, layout: Layout) -> Result<(), Failure> {
    let image = panorama.into_image(layout);
    Ok(write_picture(path, &image, PictureFormat::Png)?)
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
