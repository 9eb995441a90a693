//! Files that `refine` has written.

use super::error::ReportError;
use crate::evaluate::deformation::{SectionDeformation, read_sections};
use crate::files::limits::MAX_REPORT_BYTES;
use crate::files::read_text;
use crate::refine::{
    FrameReport, HiddenBand, LengthScale, LevelReport, MaskedReport, PointsReport, PriorTest,
    ShapeReport, StageTime, SurveyVerdict, read_covariances,
};
use crate::survey::{MASKED_FILE, MaskedWall, OverlayReport, SkippedFrame, Survey};
use crate::trajectory::{Pose, poses_of};
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// Part of `refine.json` that the report needs; `report.json` has it with the same names.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Refinement {
    /// Name and version of the refining program.
    pub program: String,
    /// Its command line.
    pub command: Vec<String>,
    /// The effective options, by name.
    pub options: Map<String, Value>,
    /// `survey.toml` at that time.
    pub survey_file: Map<String, Value>,
    /// Global solves, coarse to fine, with all steps.
    pub levels: Vec<LevelReport>,
    /// Frames in order.
    pub frames: Vec<FrameReport>,
    /// Frames whose pose rests on the prior.
    pub frames_on_prior: usize,
    /// Ratio of the covariance to that of independent noise; null if there is none.
    pub variance_factor: Option<f64>,
    /// The verdict about the survey; none in files of version 0.1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<SurveyVerdict>,
    /// The test of the prior.
    #[serde(default)]
    pub prior_test: PriorTest,
    /// The scale: how sure all lengths are; none in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<LengthScale>,
    /// The wall's shape; none if it was taken as given, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<ShapeReport>,
    /// The wall that was left out; none in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub masked: Option<MaskedReport>,
    /// The bands along the tunnel that were left out as a whole; none in files of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hidden_bands: Vec<HiddenBand>,
    /// Frames that were left out because they cannot be read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped_frames: Vec<SkippedFrame>,
    /// Pixels that do not move with the wall; none in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlay: Option<OverlayReport>,
    /// Measured points of the wall, if there were any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<PointsReport>,
    /// Self-calibration, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Calibration>,
    /// Stop reason of the last solve.
    pub stopped_because: String,
    /// Time by stage.
    pub timings: Vec<StageTime>,
    /// True if the file has keys of version 0.1, which are read for one more version.
    #[serde(skip)]
    pub has_old_keys: bool,
}

/// Self-calibration, as in `refine.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Calibration {
    /// Estimated parameters.
    pub unknowns: Vec<CalibratedUnknown>,
    /// Radius of the tunnel that belongs to the poses, metres.
    pub radius_m: f64,
    /// The camera that belongs to the poses.
    pub camera: Value,
}

/// A parameter of the self-calibration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CalibratedUnknown {
    /// Its name.
    pub name: String,
    /// Its unit: `px`, `m`, `deg`, or `1`.
    pub unit: String,
    /// The given value.
    pub initial: f64,
    /// The estimate.
    pub estimate: f64,
    /// 1-σ of the estimate, if there is one.
    pub sigma: Option<f64>,
    /// 1-σ of the given value.
    pub prior_sigma: f64,
    /// True if the frames determine it.
    pub observed: bool,
    /// Reason why it is not observable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// Name of refine's report beside the poses.
pub const REFINEMENT_FILE: &str = "refine.json";
/// Name of the table of sections beside the poses.
pub const SECTIONS_FILE: &str = "sections.csv";
/// Name of the mask of what does not move with the wall, beside the poses.
pub const OVERLAY_FILE: &str = "overlay.png";
/// Name of the poses in a folder that `refine` has written.
const POSES_FILE: &str = "poses.tum";
/// Name of the covariances beside the poses.
const COVARIANCES: &str = "covariance.csv";

/// Refined poses, and the files beside them.
#[derive(Debug)]
pub struct RefinedFiles {
    /// The file of the poses.
    pub path: PathBuf,
    /// The poses.
    pub poses: Vec<Pose>,
    /// `refine.json`, if it exists.
    pub refinement: Option<Refinement>,
    /// Covariances of the poses ([`crate::refine::Covariances::frames`]), if `covariance.csv`
    /// exists.
    pub covariances: Option<Vec<Matrix6<f64>>>,
    /// Deformation of the wall's sections, if `sections.csv` exists.
    pub sections: Option<Vec<SectionDeformation>>,
    /// The file [`OVERLAY_FILE`], if it exists.
    pub overlay: Option<Vec<u8>>,
    /// The wall that was left out, if `masked.json` exists.
    pub masked: Option<MaskedWall>,
}

impl RefinedFiles {
    /// Reads the folder that `refine` has written, or a TUM file and what `refine` has written
    /// beside it.
    ///
    /// # Errors
    /// [`ReportError`]: no poses, or files of another survey or version.
    pub fn read(survey: &Survey, path: &Path) -> Result<Self, ReportError> {
        let poses_path = poses_file(path);
        if poses_path.is_dir() {
            return Err(ReportError::NoPoses {
                path: path.to_owned(),
            });
        }
        let poses = poses_of(&survey.read_poses(&poses_path)?);
        // The files beside belong to poses.tum only, not to other poses in the folder.
        let beside = |name: &str| {
            let own = poses_path.file_name().is_some_and(|own| own == POSES_FILE);
            let path = poses_path.with_file_name(name);
            (own && path.is_file()).then_some(path)
        };
        let count = survey.frames.len();
        let refinement = beside(REFINEMENT_FILE).map(|path| read_refinement(&path, count));
        let covariances = beside(COVARIANCES).map(|path| read_covariances(&path, count));
        let sections = beside(SECTIONS_FILE).map(|path| read_section_file(&path));
        let perimeter_m = survey.nominal.perimeter_m();
        let masked = beside(MASKED_FILE).map(|path| MaskedWall::read(&path, perimeter_m));
        let overlay = beside(OVERLAY_FILE)
            .map(|path| std::fs::read(&path).map_err(|source| ReportError::Read { path, source }));
        Ok(Self {
            overlay: overlay.transpose()?,
            masked: masked.transpose()?,
            sections: sections.transpose()?,
            refinement: refinement.transpose()?,
            covariances: covariances.transpose()?,
            path: poses_path,
            poses,
        })
    }

    /// The files that were read.
    pub fn files(&self) -> Vec<PathBuf> {
        let beside = |name: &str, read: bool| read.then(|| self.path.with_file_name(name));
        let others = [
            beside(REFINEMENT_FILE, self.refinement.is_some()),
            beside(COVARIANCES, self.covariances.is_some()),
            beside(SECTIONS_FILE, self.sections.is_some()),
            beside(MASKED_FILE, self.masked.is_some()),
            beside(OVERLAY_FILE, self.overlay.is_some()),
        ];
        let poses = std::iter::once(self.path.clone());
        poses.chain(others.into_iter().flatten()).collect()
    }
}

/// The poses that `refine` has written into the folder `path`; `path` itself if it is a file or a
/// folder of other poses, such as a model of COLMAP.
pub fn poses_file(path: &Path) -> PathBuf {
    let poses = path.join(POSES_FILE);
    if poses.is_file() {
        poses
    } else {
        path.to_owned()
    }
}

fn read_section_file(path: &Path) -> Result<Vec<SectionDeformation>, ReportError> {
    let text = read_text(path, MAX_REPORT_BYTES).map_err(|source| ReportError::Read {
        path: path.to_owned(),
        source,
    })?;
    read_sections(&text).map_err(|what| ReportError::Table {
        path: path.to_owned(),
        what,
    })
}

fn read_refinement(path: &Path, frames: usize) -> Result<Refinement, ReportError> {
    let text = read_text(path, MAX_REPORT_BYTES).map_err(|source| ReportError::Read {
        path: path.to_owned(),
        source,
    })?;
    let mut refinement: Refinement =
        serde_json::from_str(&text).map_err(|error| ReportError::Parse {
            path: path.to_owned(),
            line: error.line(),
            column: error.column(),
            what: error.to_string(),
        })?;
    refinement.has_old_keys = text.contains("\"strain_px\"");
    match refinement.frames.len() {
        found if found == frames => Ok(refinement),
        found => Err(ReportError::Count {
            path: path.to_owned(),
            found,
            frames,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame as version 0.1 has written it.
    const OLD_FRAME: &str = r#"{"index": 0, "file": "a.jpg", "flag": "photometric", "points": 9,
        "residual": 2.0, "inlier_share": 0.9, "gain": 1.0, "bias": 0.0, "strain_px": 0.25,
        "sigma": {"rotation_deg": 0.1, "translation_m": 0.1, "wall_m": 0.1, "wall_px": 0.1}}"#;

    #[test]
    fn keys_of_the_version_before_are_read_and_noted() {
        let text = format!(
            r#"{{"program": "tunnelstitch 0.1.0", "command": [], "options": {{}},
                "survey_file": {{}}, "levels": [], "frames": [{OLD_FRAME}], "frames_on_prior": 0,
                "variance_factor": 1.0, "stopped_because": "", "timings": []}}"#
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("refine.json");
        std::fs::write(&path, &text).unwrap();
        let old = read_refinement(&path, 1).unwrap();
        assert_eq!(old.frames[0].overdispersion_px, 0.25);
        assert!(old.has_old_keys);
        std::fs::write(&path, text.replace("strain_px", "overdispersion_px")).unwrap();
        let new = read_refinement(&path, 1).unwrap();
        assert_eq!(new.frames[0].overdispersion_px, 0.25);
        assert!(!new.has_old_keys);
    }
}
