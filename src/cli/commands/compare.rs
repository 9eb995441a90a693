//! `tunnelstitch compare`: compares initial with refined poses.

use crate::cli::arguments::{
    PictureArguments, PoseReadingArguments, input_file, output_folder, positive,
};
use crate::cli::commands::overlay::leave_out_overlay;
use crate::cli::output::{
    DryRunArguments, Failure, Job, RUN_FILE, RunRecord, Terminal, json, record,
};
use crate::evaluate::{
    ComparedPanoramas, Comparison, compare_survey, draw_before_after, plan_survey_comparison,
};
use crate::files::printed;
use crate::frames::{PictureFormat, add_picture};
use crate::persist::atomic::{self, OutputSet};
use crate::progress::Progress;
use crate::render::Layout;
use crate::report::poses_file;
use crate::survey::Survey;
use crate::trajectory::{Pose, poses_of};
use image::DynamicImage;
use serde::Serialize;
use std::path::{Path, PathBuf};
use tunnelstitch_core::PROGRAM;

/// Compares the survey's initial poses with refined ones, and both with the true ones if known.
///
/// Writes baseline.png, refined.png and truth.png (all of the same part of the wall),
/// before-after.png (an extract of the first above the second) and compare.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  \
    tunnelstitch compare my-survey --refined refined --out compared")]
pub struct CompareArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// Folder that refine has written, or poses in any format, in the tunnel's frame as `refine`
    /// and `convert` write them. The flags for reading poses apply to those of the survey only;
    /// convert poses of another convention first. Camera and wall are those that `refine` has found
    /// and written beside them, for all poses. `-` reads poses from standard input.
    #[arg(long, value_name = "DIR|FILE", value_parser = input_file())]
    refined: PathBuf,
    /// Folder for the results; created if missing.
    #[arg(long, short, value_name = "DIR", value_parser = output_folder())]
    out: PathBuf,
    #[command(flatten)]
    picture: PictureArguments,
    /// Exit with code 4 if the error of the refined poses on the wall (root mean square, pixels) is
    /// larger than this. Needs true poses.
    #[arg(long, value_name = "X", value_parser = positive)]
    max_wall_px: Option<f64>,
    #[command(flatten)]
    reading: PoseReadingArguments,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Extract of the initial above the refined panorama.
const BEFORE_AFTER: &str = "before-after.png";
/// Panorama of the initial poses.
const BASELINE_PICTURE: &str = "baseline.png";
/// Panorama of the refined poses.
const REFINED_PICTURE: &str = "refined.png";
/// Panorama of the true poses.
const TRUTH_PICTURE: &str = "truth.png";
/// All errors.
const COMPARISON_FILE: &str = "compare.json";

/// `compare.json`.
#[derive(Serialize)]
struct ComparisonReport<'a> {
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
pub fn run(
    arguments: &CompareArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let mut survey =
        arguments
            .reading
            .open_beside(&arguments.survey, &arguments.refined, terminal)?;
    if arguments.max_wall_px.is_some() && survey.truth.is_none() {
        return Err(Failure::usage(
            "--max-wall-px needs true poses, and the survey has no poses.truth",
        ));
    }
    let refined_file = poses_file(&arguments.refined);
    let refined = poses_of(&survey.read_poses(&refined_file)?);
    atomic::check_folder(&arguments.out)?;
    if arguments.dry_run.is_set() {
        return describe(arguments, &survey, &refined, &refined_file)?.print(terminal);
    }
    leave_out_overlay(&mut survey, terminal)?;
    let (comparison, drawings) = compare_survey(
        &survey,
        &refined,
        arguments.picture.canvas.px_per_metre,
        arguments.picture.interpolation.into(),
        terminal,
    )?;
    let (json, mut outputs) = stage_comparison(
        &survey,
        &refined_file,
        arguments.picture.canvas.layout.into(),
        &comparison,
        drawings,
        &arguments.out,
        terminal,
    )?;
    let inputs = record::hash_survey(&survey, [refined_file.as_path()])?;
    record.add_to(&mut outputs, &arguments.out.join(RUN_FILE), &inputs)?;
    outputs.commit()?;
    if terminal.is_json() {
        json::print_text(&json)?;
    } else {
        terminal.say(comparison.to_string());
        terminal.say(format!("wrote {}", printed(&arguments.out)));
    }
    check_quality(&comparison, arguments.max_wall_px)
}

/// The work, which is checked as far as is possible without frames.
///
/// # Errors
/// Poses that cannot be placed on the wall, too little memory.
fn describe(
    arguments: &CompareArguments,
    survey: &Survey,
    refined: &[Pose],
    refined_file: &Path,
) -> Result<Job, Failure> {
    let canvas = &arguments.picture.canvas;
    let plan = plan_survey_comparison(survey, refined, canvas.px_per_metre)?;
    let truth = survey.truth.as_ref().map(|_| TRUTH_PICTURE);
    let names = [BEFORE_AFTER, BASELINE_PICTURE, REFINED_PICTURE].into_iter();
    let names = names.chain(truth).chain([COMPARISON_FILE, RUN_FILE]);
    Ok(Job {
        writes: names.map(|name| arguments.out.join(name)).collect(),
        panorama_px: Some(Layout::from(canvas.layout).size(&plan.canvas)),
        memory_bytes: Some(plan.memory_bytes),
        ..Job::of(survey, [refined_file])
    })
}

/// Writes the panoramas and compare.json for `out`; returns the text of compare.json and the files,
/// which have not their names yet.
///
/// # Errors
/// An output that cannot be written.
pub fn stage_comparison(
    survey: &Survey,
    refined_file: &Path,
    layout: Layout,
    comparison: &Comparison,
    drawings: ComparedPanoramas,
    out: &Path,
    terminal: &Terminal,
) -> Result<(String, OutputSet), Failure> {
    let json = json::text(&ComparisonReport {
        program: PROGRAM,
        survey: &survey.folder,
        refined_poses: refined_file,
        layout,
        comparison,
    })?;
    terminal.start("writing", 4);
    let mut outputs = OutputSet::default();
    let mut write = |name: &str, image: &DynamicImage| -> Result<(), Failure> {
        add_picture(&mut outputs, &out.join(name), image, PictureFormat::Png)?;
        terminal.advance(1);
        Ok(())
    };
    let baseline = drawings.baseline.panorama.into_image(Layout::ThetaRight);
    let refined = drawings.refined.panorama.into_image(Layout::ThetaRight);
    write(BEFORE_AFTER, &draw_before_after(&baseline, &refined).into())?;
    write(BASELINE_PICTURE, &layout.turn(baseline))?;
    write(REFINED_PICTURE, &layout.turn(refined))?;
    match drawings.truth {
        Some(truth) => write(TRUTH_PICTURE, &truth.panorama.into_image(layout))?,
        // A picture of an earlier comparison would show other poses.
        None => outputs.remove(&out.join(TRUTH_PICTURE))?,
    }
    terminal.finish();
    outputs.write_text(&out.join(COMPARISON_FILE), &json)?;
    Ok((json, outputs))
}

/// Fails if the error of the refined poses on the wall is above the limit.
fn check_quality(comparison: &Comparison, max_wall_px: Option<f64>) -> Result<(), Failure> {
    match (max_wall_px, &comparison.refined.wall) {
        (Some(limit), Some(wall)) if wall.px.rms > limit => Err(Failure::quality(format!(
            "the error of the refined poses on the wall is {:.4} px (root mean square), more than \
             --max-wall-px {limit}",
            wall.px.rms
        ))),
        _ => Ok(()),
    }
}
