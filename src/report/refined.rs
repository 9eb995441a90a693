//! What `refine` has left in its folder.

use super::ReportError;
use crate::refine::{FrameReport, LevelReport, StageTime, read_covariances};
use crate::survey::Survey;
use crate::trajectory::{Pose, poses_of};
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// `refine.json`, as far as the report needs it; in `report.json` with the same names and numbers.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Refinement {
    /// Name and version of the program that refined.
    pub program: String,
    /// The command line that did.
    pub command: Vec<String>,
    /// The effective options, by name.
    pub options: Map<String, Value>,
    /// `survey.toml` as it was then.
    pub survey_file: Map<String, Value>,
    /// Global solves, coarse to fine, with every step.
    pub levels: Vec<LevelReport>,
    /// Frames in order.
    pub frames: Vec<FrameReport>,
    /// Frames whose pose rests on the prior.
    pub frames_on_prior: usize,
    /// The covariance over that of independent noise; null where there is none.
    pub variance_factor: Option<f64>,
    /// Self-calibration, if it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Calibration>,
    /// Why the last solve stopped, in words.
    pub stopped_because: String,
    /// Time by stage.
    pub timings: Vec<StageTime>,
}

/// Self-calibration, as in `refine.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Calibration {
    /// What was to be estimated.
    pub unknowns: Vec<CalibratedUnknown>,
    /// The tunnel's radius that belongs to the poses, metres.
    pub radius_m: f64,
    /// The camera that belongs to the poses.
    pub camera: Value,
}

/// One unknown of the self-calibration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CalibratedUnknown {
    /// Its name.
    pub name: String,
    /// Its unit: `px`, `m`, `deg`, or `1`.
    pub unit: String,
    /// The value given.
    pub initial: f64,
    /// The estimate.
    pub estimate: f64,
    /// 1-σ of the estimate, if there is one.
    pub sigma: Option<f64>,
    /// 1-σ of the value given.
    pub prior_sigma: f64,
    /// Whether the data observe it.
    pub observed: bool,
    /// Why not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// Names of what lies beside refined poses.
const REFINEMENT: &str = "refine.json";
const COVARIANCES: &str = "covariance.csv";

/// Refined poses, and what lies beside them.
#[derive(Debug)]
pub struct RefinedFiles {
    /// The file of the poses.
    pub path: PathBuf,
    /// The poses.
    pub poses: Vec<Pose>,
    /// `refine.json`, if it is there.
    pub refinement: Option<Refinement>,
    /// The poses' covariances ([`crate::refine::Covariances::frames`]), if `covariance.csv` is
    /// there.
    pub covariances: Option<Vec<Matrix6<f64>>>,
}

impl RefinedFiles {
    /// Reads the folder that `refine` has written, or a TUM file and what `refine` has written
    /// beside it.
    ///
    /// # Errors
    /// [`ReportError`]: no poses, or files of another survey or version.
    pub fn read(survey: &Survey, path: &Path) -> Result<Self, ReportError> {
        let poses_path = if path.is_dir() {
            path.join("poses.tum")
        } else {
            path.to_owned()
        };
        if path.is_dir() && !poses_path.is_file() {
            return Err(ReportError::NoPoses {
                path: path.to_owned(),
            });
        }
        let poses = poses_of(&survey.read_poses(&poses_path)?);
        // Other poses than refine's own may lie beside its files, which say nothing of them.
        let beside = |name: &str| {
            let own = poses_path.file_name().is_some_and(|own| own == "poses.tum");
            let path = poses_path.with_file_name(name);
            (own && path.is_file()).then_some(path)
        };
        let count = survey.frames.len();
        let refinement = beside(REFINEMENT).map(|path| read_refinement(&path, count));
        let covariances = beside(COVARIANCES).map(|path| read_covariances(&path, count));
        Ok(Self {
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
            beside(REFINEMENT, self.refinement.is_some()),
            beside(COVARIANCES, self.covariances.is_some()),
        ];
        let poses = std::iter::once(self.path.clone());
        poses.chain(others.into_iter().flatten()).collect()
    }
}

fn read_refinement(path: &Path, frames: usize) -> Result<Refinement, ReportError> {
    let text = std::fs::read_to_string(path).map_err(|source| ReportError::Read {
        path: path.to_owned(),
        source,
    })?;
    let refinement: Refinement =
        serde_json::from_str(&text).map_err(|error| ReportError::Parse {
            path: path.to_owned(),
            line: error.line(),
            column: error.column(),
            what: error.to_string(),
        })?;
    match refinement.frames.len() {
        found if found == frames => Ok(refinement),
        found => Err(ReportError::Count {
            path: path.to_owned(),
            found,
            frames,
        }),
    }
}
