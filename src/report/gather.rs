//! Computes the numbers of the report from its sources.

use super::deformation::gather_deformation;
use super::error::ReportError;
use super::masked_wall::MaskedMap;
use super::model::{
    Abscissa, FrameRow, Report, ResultSummary, SCHEMA_VERSION, SurveyFacts, WallMaps,
};
use super::pictures::{Pictures, panoramas, thumbnails};
use super::refined_files::{OVERLAY_FILE, REFINEMENT_FILE, RefinedFiles, Refinement};
use crate::evaluate::{ComparedPanoramas, Comparison, SeamMap, WallError};
use crate::files::printed;
use crate::refine::FrameFlag;
use crate::survey::Survey;
use crate::trajectory::{Pose, poses_of};
use nalgebra::Vector3;
use serde::Serialize;
use serde_json::{Map, Value};
use std::path::Path;
use tunnelstitch_core::PROGRAM;
use tunnelstitch_geometry::numerics::median::upper_median;

/// Sources of a report.
#[derive(Debug)]
pub struct Sources<'a> {
    /// The survey.
    pub survey: &'a Survey,
    /// Its refined poses.
    pub refined: RefinedFiles,
    /// Comparison of initial and refined poses.
    pub comparison: &'a Comparison,
    /// The panoramas of the comparison.
    pub drawings: &'a ComparedPanoramas,
    /// Command line of the report.
    pub command: Vec<String>,
}

/// Computes the report and its pictures.
///
/// # Errors
/// A flagged frame that cannot be read; a picture that cannot be encoded.
pub fn gather(sources: Sources) -> Result<(Report, Pictures), ReportError> {
    let Sources {
        survey,
        refined,
        comparison,
        drawings,
        command,
    } = sources;
    let frames = frame_rows(survey, &refined);
    let flagged: Vec<usize> = refined.refinement.iter().flat_map(flagged).collect();
    let mut pictures = Pictures::new();
    let thumbnails = thumbnails(survey, &flagged, &mut pictures)?;
    let wall = wall_maps(drawings);
    let panoramas = panoramas(&comparison.canvas, drawings, &mut pictures)?;
    let mut commands: Vec<Vec<String>> = Vec::new();
    let first = refined.refinement.iter().map(|r| r.command.clone());
    for line in first.chain([command]) {
        if !line.is_empty() && !commands.contains(&line) {
            commands.push(line);
        }
    }
    if let Some(overlay) = &refined.overlay {
        pictures.insert(OVERLAY_FILE.to_owned(), overlay.clone());
    }
    let report = Report {
        schema_version: SCHEMA_VERSION,
        program: PROGRAM.to_owned(),
        commands,
        survey: survey_facts(survey, &refined.path),
        summary: summarise(&frames, refined.refinement.as_ref(), comparison),
        abscissa: abscissa(&frames),
        frames,
        notes: notes(survey, &refined, comparison),
        comparison: comparison.clone(),
        panoramas,
        wall,
        deformation: gather_deformation(survey, &refined)?,
        masked: refined.masked.as_ref().and_then(MaskedMap::new),
        thumbnails,
        refinement: refined.refinement,
    };
    Ok((report, pictures))
}

/// Indices of frames that are not photometric.
fn flagged(refinement: &Refinement) -> impl Iterator<Item = usize> {
    let frames = refinement.frames.iter().enumerate();
    frames
        .filter(|(_, frame)| frame.flag != FrameFlag::Photometric)
        .map(|(k, _)| k)
}

fn survey_facts(survey: &Survey, refined_poses: &Path) -> SurveyFacts {
    let absolute = std::path::absolute(&survey.folder).unwrap_or_else(|_| survey.folder.clone());
    let name = absolute.components().next_back();
    SurveyFacts {
        name: name.map_or_else(String::new, |name| {
            name.as_os_str().to_string_lossy().into_owned()
        }),
        folder: printed(&survey.folder).to_string(),
        refined_poses: printed(refined_poses).to_string(),
        frames: survey.frames.len(),
        frame_size_px: survey.cameras.size(),
        perimeter_m: survey.surface.perimeter_m(),
        truth: survey.truth.is_some(),
        file: object(&survey.file),
        camera: camera_facts(survey),
    }
}

/// The camera, or those of a rig by their numbers.
fn camera_facts(survey: &Survey) -> Map<String, Value> {
    if !survey.cameras.is_rig() {
        return object(survey.cameras.of(0));
    }
    let cameras = survey.cameras.all().iter().enumerate();
    cameras
        .map(|(k, camera)| (k.to_string(), Value::Object(object(camera))))
        .collect()
}

/// A struct as a JSON object.
fn object(value: &impl Serialize) -> Map<String, Value> {
    match serde_json::to_value(value) {
        Ok(Value::Object(object)) => object,
        _ => Map::new(),
    }
}

/// Lists the poses of every frame.
fn frame_rows(survey: &Survey, refined: &RefinedFiles) -> Vec<FrameRow> {
    let truth = survey.truth.as_deref().map(|truth| {
        let truth = poses_of(truth);
        let gauge = survey.surface.gauge();
        gauge.align(&truth, &refined.poses).apply_all(&truth)
    });
    let rows = survey.frames.iter().zip(&survey.initial).enumerate();
    rows.zip(&refined.poses)
        .map(|((k, (file, initial)), pose)| {
            let initial_pose = &initial.pose;
            let truth = truth.as_ref().and_then(|truth| truth.get(k));
            let correction = rotation_deg(initial_pose, pose);
            let covariance = refined.covariances.as_ref().and_then(|all| all.get(k));
            let sigma = |first: usize| -> Option<[f64; 3]> {
                let sigma = [0, 1, 2]
                    .map(|axis| covariance.map(|c| c[(first + axis, first + axis)].sqrt()));
                let [Some(x), Some(y), Some(z)] = sigma else {
                    return None;
                };
                [x, y, z].iter().all(|v| v.is_finite()).then_some([x, y, z])
            };
            FrameRow {
                index: k,
                file: file.name(),
                time_s: initial.time_s,
                initial_m: initial_pose.t_wc.into(),
                refined_m: pose.t_wc.into(),
                true_m: truth.map(|pose| pose.t_wc.into()),
                correction_rotation_deg: correction.into(),
                true_rotation_deg: truth.map(|pose| rotation_deg(initial_pose, pose).into()),
                correction_angle_deg: correction.norm(),
                correction_distance_m: (pose.t_wc - initial_pose.t_wc).norm(),
                sigma_rotation_deg: sigma(0).map(|sigma| sigma.map(f64::to_degrees)),
                sigma_translation_m: sigma(3),
            }
        })
        .collect()
}

/// Rotation vector between two poses, about the camera's axes, degrees.
fn rotation_deg(from: &Pose, to: &Pose) -> Vector3<f64> {
    from.local(to).fixed_rows::<3>(0).map(f64::to_degrees)
}

/// Chooses the chainage if it is monotonic, else the frame's index.
fn abscissa(frames: &[FrameRow]) -> Abscissa {
    let chainages: Vec<f64> = frames.iter().map(|frame| frame.refined_m[1]).collect();
    let ahead = chainages.windows(2).all(|pair| pair[0] <= pair[1]);
    let back = chainages.windows(2).all(|pair| pair[0] >= pair[1]);
    let moves = chainages.first() != chainages.last();
    if (ahead || back) && moves {
        Abscissa::Chainage
    } else {
        Abscissa::Frame
    }
}

/// Computes the key figures.
fn summarise(
    frames: &[FrameRow],
    refinement: Option<&Refinement>,
    comparison: &Comparison,
) -> ResultSummary {
    let sigma = |pick: fn(&crate::refine::FrameSigma) -> f64| {
        let frames = refinement?.frames.iter();
        let photometric = frames.filter(|frame| frame.flag == FrameFlag::Photometric);
        upper_median(photometric.map(|frame| pick(&frame.sigma)).collect())
    };
    let wall = comparison.refined.wall.as_ref();
    let error = |pick: fn(&WallError) -> &[f64]| {
        let of_frames = refinement?.frames.iter().zip(pick(wall?));
        let photometric = of_frames.filter(|(frame, _)| frame.flag == FrameFlag::Photometric);
        let squares: Vec<f64> = photometric.map(|(_, rms)| rms * rms).collect();
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        (!squares.is_empty()).then(|| mean.sqrt())
    };
    let flagged = refinement.map(|refinement| flagged(refinement).count());
    let of_frames = |pick: fn(&FrameRow) -> f64| {
        upper_median(frames.iter().map(pick).collect()).unwrap_or_default()
    };
    ResultSummary {
        photometric: flagged.map(|flagged| frames.len() - flagged),
        flagged,
        correction_rotation_deg: of_frames(|frame| frame.correction_angle_deg),
        correction_translation_m: of_frames(|frame| frame.correction_distance_m),
        sigma_wall_mm: sigma(|sigma| 1e3 * sigma.wall_m),
        sigma_wall_px: sigma(|sigma| sigma.wall_px),
        error_wall_mm: error(|wall| &wall.frame_rms_mm),
        error_wall_px: error(|wall| &wall.frame_rms_px),
    }
}

/// Rounds the maps of the comparison.
fn wall_maps(drawings: &ComparedPanoramas) -> WallMaps {
    let map = &drawings.refined.seams;
    let residual = |map: &SeamMap| -> Vec<Option<f64>> {
        map.rms_grey()
            .iter()
            .map(|value| value.map(rounded))
            .collect()
    };
    let [around, along] = map.size();
    WallMaps {
        around,
        along,
        chainage_m: map.chainage_m(),
        baseline_grey: residual(&drawings.baseline.seams),
        refined_grey: residual(map),
        true_grey: drawings.truth.as_ref().map(|truth| residual(&truth.seams)),
        refined_frames: map.frames().into_iter().map(rounded).collect(),
    }
}

/// Rounds to two decimals, which are enough for the maps.
fn rounded(value: f64) -> f64 {
    (100.0 * value).round() / 100.0
}

/// Lists the limitations of the report.
fn notes(survey: &Survey, refined: &RefinedFiles, comparison: &Comparison) -> Vec<String> {
    let mut notes = Vec::new();
    let is_beside = |name: &str| format!("{name} is beside the refined poses");
    match &refined.refinement {
        None => notes.push(format!(
            "No {}, so flags, residuals, costs and options are not known.",
            is_beside(REFINEMENT_FILE)
        )),
        Some(refinement) => {
            if refinement.has_old_keys {
                notes.push(
                    "refine.json is of version 0.1: its key strain_px is read as \
                     overdispersion_px, for one more version. Refine again to renew it."
                        .to_owned(),
                );
            }
            if let Some(calibration) = &refinement.calibration
                && (calibration.radius_m != survey.file.tunnel.nominal_m()
                    || calibration.camera != Value::Object(object(survey.cameras.of(0))))
            {
                notes.push(
                    "The poses were refined together with the calibration, but this report uses \
                     the given calibration. Make the report of the folder that refine has written: \
                     it is a survey with the refined calibration."
                        .to_owned(),
                );
            }
        }
    }
    notes.extend(survey.skipped_sentence().map(|sentence| sentence + "."));
    if refined.covariances.is_none() {
        notes.push(format!(
            "No {}, so the uncertainty is not known.",
            is_beside("covariance.csv")
        ));
    }
    if survey.truth.is_none() {
        notes.push(
            "True poses are not known, so errors cannot be computed. The seam residual shows how \
             well the frames agree."
                .to_owned(),
        );
    }
    if comparison.refined.seam.is_none() {
        notes.push("No two frames overlap with the refined poses.".to_owned());
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(index: usize, h_m: f64) -> FrameRow {
        FrameRow {
            index,
            file: String::new(),
            time_s: index as f64,
            initial_m: [0.0; 3],
            refined_m: [0.0, h_m, 0.0],
            true_m: None,
            correction_rotation_deg: [0.0; 3],
            true_rotation_deg: None,
            correction_angle_deg: 0.0,
            correction_distance_m: 0.0,
            sigma_rotation_deg: None,
            sigma_translation_m: None,
        }
    }

    #[test]
    fn charts_run_along_the_chainage_unless_it_turns_back_or_stands_still() {
        let along = |chainages: &[f64]| {
            let rows: Vec<FrameRow> = (0..).zip(chainages).map(|(k, h_m)| row(k, *h_m)).collect();
            abscissa(&rows)
        };
        assert_eq!(along(&[0.0, 0.1, 0.1, 0.2]), Abscissa::Chainage);
        assert_eq!(along(&[0.0, -0.1, -0.2]), Abscissa::Chainage);
        assert_eq!(along(&[0.0, 0.1, 0.05]), Abscissa::Frame);
        assert_eq!(along(&[1.0, 1.0, 1.0]), Abscissa::Frame);
    }

    #[test]
    fn the_median_ignores_nan() {
        assert_eq!(upper_median(vec![3.0, f64::NAN, 1.0, 2.0]), Some(2.0));
        assert_eq!(upper_median(vec![f64::NAN]), None);
    }
}
