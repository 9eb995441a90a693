//! Files that `refine` writes.

use crate::camera::format_calibration;
use crate::cli::output::{Failure, RUN_FILE, RunRecord, Terminal, json};
use crate::evaluate::deformation::{
    ShapeEstimate, deviation_sigmas_m, measure_sections, sections_csv,
};
use crate::files::printed;
use crate::frames::{PictureFormat, add_picture};
use crate::persist::atomic::{self, OutputSet};
use crate::persist::checkpoint::Checkpoint;
use crate::progress::Progress;
use crate::refine::{
    EstimatedShape, RefineError, RefineInput, RefineOptions, RefineReport, Refined, ShardState,
    WallPoints, join_shards, refine_with_checkpoint, search_readings,
};
use crate::report::{OVERLAY_FILE, REFINEMENT_FILE, SECTIONS_FILE};
use crate::surface::Bend;
use crate::survey::{
    FoundFiles, MASKED_FILE, MaskedWall, Overlay, OverlayReport, SURVEY_FILE, ShapeFile,
    SkippedFrame, Survey, SurveyFile,
};
use crate::trajectory::tum;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use tunnelstitch_core::PROGRAM;

/// Name of the refined poses.
const POSES_FILE: &str = "poses.tum";
/// Name of the refined poses of a rig's body.
const BODY_FILE: &str = "poses_body.tum";
/// Name of the covariances.
const COVARIANCE_FILE: &str = "covariance.csv";
/// Name of the wall's shape.
const SHAPE_FILE: &str = "shape.json";
/// Name of the refined calibration.
const CAMERA_FILE: &str = "camera.json";

/// Files that every refinement writes.
pub const REFINED_FILES: [&str; 5] = [
    POSES_FILE,
    REFINEMENT_FILE,
    COVARIANCE_FILE,
    SURVEY_FILE,
    RUN_FILE,
];

/// Files that a refinement writes if it has found something for them, and removes otherwise.
pub const FOUND_FILES: [&str; 6] = [
    BODY_FILE,
    MASKED_FILE,
    OVERLAY_FILE,
    CAMERA_FILE,
    SHAPE_FILE,
    SECTIONS_FILE,
];

/// `refine.json`.
#[derive(Serialize)]
struct RefineFile<'a> {
    /// Name and version of the program.
    program: &'static str,
    /// The command line.
    command: &'a [String],
    /// Path of the survey as given, and the content of its survey.toml.
    survey: &'a Path,
    survey_file: &'a SurveyFile,
    /// The effective options.
    options: &'a RefineOptions,
    /// Frames that are left out because they cannot be read.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    skipped_frames: &'a [SkippedFrame],
    /// Pixels that do not move with the wall.
    overlay: &'a OverlayReport,
    #[serde(flatten)]
    report: &'a RefineReport,
}

/// Refines a survey, from its shards if there are some, continuing from a checkpoint if there is
/// one, and writes poses.tum,
/// refine.json and covariance.csv for `out`, shape.json and sections.csv if the wall is deformed,
/// overlay.png if `overlay` has a mask.
/// Also returns the text of refine.json and the files, which have not their names yet.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn stage_refined(
    survey: &Survey,
    overlay: &Overlay,
    options: &RefineOptions,
    out: &Path,
    record: &RunRecord,
    (shards, checkpoint): (Option<Vec<ShardState>>, Option<&mut Checkpoint>),
    terminal: &Arc<Terminal>,
) -> Result<(Refined, String, OutputSet), Failure> {
    let progress: Arc<dyn Progress> = Arc::clone(terminal) as Arc<dyn Progress>;
    let points = WallPoints::of_survey(survey)?;
    let input = RefineInput {
        points: points.as_ref(),
        ..RefineInput::from(survey)
    };
    let refined = match shards {
        Some(shards) => join_shards(input, options, shards, checkpoint, &progress),
        None => refine_with_checkpoint(input, options, checkpoint, &progress),
    };
    let refined = refined.map_err(|error| explain(survey, error))?;
    let json = json::text(&RefineFile {
        program: PROGRAM,
        command: &record.arguments,
        survey: &survey.folder,
        survey_file: &survey.file,
        options,
        skipped_frames: &survey.skipped,
        overlay: &overlay.report,
        report: &refined.report,
    })?;
    let mut outputs = OutputSet::default();
    outputs.write_text(&out.join(POSES_FILE), &tum::format(&refined.trajectory))?;
    let bodies = out.join(BODY_FILE);
    match &refined.bodies {
        Some(poses) => outputs.write_text(&bodies, &tum::format(poses))?,
        None => outputs.remove(&bodies)?,
    }
    outputs.write_text(&out.join(REFINEMENT_FILE), &json)?;
    let sigmas: Vec<_> = refined
        .report
        .frames
        .iter()
        .map(|frame| frame.sigma)
        .collect();
    let covariances = refined.covariances.csv(&sigmas);
    outputs.write_text(&out.join(COVARIANCE_FILE), &covariances)?;
    add_masked_wall(&mut outputs, refined.masked.as_ref(), out)?;
    add_overlay(&mut outputs, overlay, out)?;
    add_survey(&mut outputs, survey, &refined, out)?;
    Ok((refined, json, outputs))
}

/// Adds the wall where frames were left out; removes that of an earlier run.
fn add_masked_wall(
    outputs: &mut OutputSet,
    masked: Option<&MaskedWall>,
    out: &Path,
) -> Result<(), Failure> {
    let path = out.join(MASKED_FILE);
    match masked {
        // On one line: indented, each number of its tables would have its own.
        Some(masked) => {
            let text = serde_json::to_string(masked).map_err(|error| {
                Failure::bug(format!("cannot make JSON of {MASKED_FILE}: {error}"))
            })?;
            Ok(outputs.write_text(&path, &(text + "\n"))?)
        }
        None => Ok(outputs.remove(&path)?),
    }
}

/// Adds the mask of what does not move with the wall; removes that of an earlier run.
fn add_overlay(outputs: &mut OutputSet, overlay: &Overlay, out: &Path) -> Result<(), Failure> {
    let path = out.join(OVERLAY_FILE);
    match &overlay.mask {
        Some(mask) => Ok(add_picture(
            outputs,
            &path,
            &mask.picture().into(),
            PictureFormat::Png,
        )?),
        None => Ok(outputs.remove(&path)?),
    }
}

/// Checks the folder of the results before any work is done.
///
/// # Errors
/// A folder that cannot be created or written into; the survey's own folder, whose files would be
/// replaced.
pub fn check_outputs(survey: &Survey, out: &Path) -> Result<(), Failure> {
    atomic::check_folder(out)?;
    match (survey.folder.canonicalize(), out.canonicalize()) {
        (Ok(survey), Ok(folder)) if survey == folder => Err(Failure::input(format!(
            "{}: --out must not be the survey's own folder, whose {SURVEY_FILE} would be replaced",
            printed(out)
        ))),
        _ => Ok(()),
    }
}

/// Adds the calibration and the shape that were found, and a `survey.toml` that uses them with the
/// survey's frames and initial poses; removes those of an earlier run.
fn add_survey(
    outputs: &mut OutputSet,
    survey: &Survey,
    refined: &Refined,
    out: &Path,
) -> Result<(), Failure> {
    let calibration = refined.report.calibration.as_ref();
    let mut text_of = |file: &str, text: Option<String>| match text {
        Some(text) => outputs.write_text(&out.join(file), &text),
        None => outputs.remove(&out.join(file)),
    };
    // The cameras of a rig are as given.
    let of_camera = calibration.filter(|_| !survey.cameras.is_rig());
    let camera = of_camera.map(|calibration| format_calibration(&calibration.camera));
    text_of(CAMERA_FILE, camera)?;
    let is_found = refined.shape.is_some() || refined.bend.is_some();
    let file = survey.as_found(&FoundFiles {
        camera_file: of_camera.map(|_| CAMERA_FILE),
        radius_m: calibration.map(|calibration| calibration.radius_m),
        shape_file: is_found.then_some(SHAPE_FILE),
    });
    let (shape, sections) = match (&refined.shape, refined.bend) {
        (Some(shape), bend) => {
            let (shape, sections) = shape_files(shape, bend, &file, out)?;
            (Some(shape), Some(sections))
        }
        (None, Some(bend)) => {
            let shape = ShapeFile::of_bend(bend, survey.nominal.perimeter_m());
            (Some(json::text(&shape)?), None)
        }
        (None, None) => (None, None),
    };
    text_of(SHAPE_FILE, shape)?;
    text_of(SECTIONS_FILE, sections)?;
    let text = toml::to_string(&file).map_err(|error| Failure::bug(error.to_string()))?;
    let text = format!("# The survey with the camera and the wall that refine has found.\n{text}");
    Ok(outputs.write_text(&out.join(SURVEY_FILE), &text)?)
}

/// Texts of shape.json and of sections.csv, for the tunnel of `file`.
fn shape_files(
    shape: &EstimatedShape,
    bend: Option<Bend>,
    file: &SurveyFile,
    out: &Path,
) -> Result<(String, String), Failure> {
    let nominal = file.tunnel.surface(&out.join(SURVEY_FILE), out)?;
    let estimate = ShapeEstimate {
        nominal: nominal.as_ref(),
        field: &shape.field,
        error_draws: &shape.error_draws,
        prior_sigma_m: shape.prior_sigma_m,
        extent_h_m: shape.extent_h_m,
    };
    let deviation_sigmas_m = deviation_sigmas_m(&estimate);
    let sections = measure_sections(&estimate, &deviation_sigmas_m);
    let shape_file = ShapeFile::new(&shape.field, shape.sigma_m.clone())
        .with_deviation_sigma_m(deviation_sigmas_m)
        .with_bend(bend);
    Ok((json::text(&shape_file)?, sections_csv(&sections)))
}

/// The failure of a refinement; where nothing overlaps, with the reading of the survey that
/// neighbouring frames agree with.
fn explain(survey: &Survey, error: RefineError) -> Failure {
    let is_apart = matches!(error, RefineError::NoOverlap);
    let readings = is_apart.then(|| search_readings(survey).ok().flatten());
    match readings.flatten() {
        Some(found) => Failure::input(format!("{error}; {}", found.sentence())),
        None => error.into(),
    }
}
