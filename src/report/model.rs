//! Content of `report.json`.
//!
//! Names end with the unit: metres, degrees, 8-bit grey levels. Numbers that do not exist (no true
//! poses, no covariance) are null or missing. Lists of frames are in the order of the survey.

use super::deformation::Deformation;
use super::masked_wall::MaskedMap;
use super::refined_files::Refinement;
use crate::evaluate::Comparison;
use crate::render::Layout;
use serde::{Deserialize, Serialize};

/// Version of the schema of `report.json`. It increases when a name, a unit or a meaning changes,
/// not when something is added.
pub const SCHEMA_VERSION: u32 = 1;

/// Content of `report.json` and of the page.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Report {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name and version of the program.
    pub program: String,
    /// Command lines of refine, if known, and of the report, in this order.
    pub commands: Vec<Vec<String>>,
    /// The survey.
    pub survey: SurveyFacts,
    /// Key figures of the result.
    #[serde(rename = "verdict")]
    pub summary: ResultSummary,
    /// Abscissa of frames in charts.
    pub abscissa: Abscissa,
    /// Poses of every frame.
    pub frames: Vec<FrameRow>,
    /// Initial against refined poses, as in `compare.json`.
    pub comparison: Comparison,
    /// Pictures of the unrolled wall.
    pub panoramas: PanoramaStrips,
    /// Residuals and overlap on the wall.
    pub wall: WallMaps,
    /// Deformation of the wall; null if none was found.
    #[serde(default)]
    pub deformation: Option<Deformation>,
    /// The wall that was left out; null if it is not known.
    #[serde(default)]
    pub masked: Option<MaskedMap>,
    /// Thumbnails of the first flagged frames.
    pub thumbnails: Vec<Thumbnail>,
    /// Report of refine; null for poses of another program.
    pub refinement: Option<Refinement>,
    /// Limitations of the report by its sources.
    pub notes: Vec<String>,
}

/// Data of the survey.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurveyFacts {
    /// Name of the survey's folder.
    pub name: String,
    /// The folder as given.
    pub folder: String,
    /// The file of the refined poses as given.
    pub refined_poses: String,
    /// Number of frames.
    pub frames: usize,
    /// Width and height of the frames, pixels.
    pub frame_size_px: [u32; 2],
    /// Length of the section's outline, metres.
    pub perimeter_m: f64,
    /// True if true poses are known.
    pub truth: bool,
    /// Current content of `survey.toml`.
    pub file: serde_json::Map<String, serde_json::Value>,
    /// The camera; those of a rig by their numbers.
    pub camera: serde_json::Map<String, serde_json::Value>,
}

/// Key figures of the result; residuals and errors against the true poses are in
/// [`Report::comparison`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ResultSummary {
    /// Number of frames whose pose rests on their pixels; null if refine's report is missing.
    #[serde(rename = "repaired")]
    pub photometric: Option<usize>,
    /// Number of frames whose pose rests on the prior.
    pub flagged: Option<usize>,
    /// Median rotation angle between initial and refined pose, degrees.
    pub correction_rotation_deg: f64,
    /// Median distance between initial and refined position, metres.
    pub correction_translation_m: f64,
    /// Median 1-σ of the photometric frames on the wall, millimetres.
    pub sigma_wall_mm: Option<f64>,
    /// Median 1-σ of the photometric frames on the wall, pixels of the frames.
    pub sigma_wall_px: Option<f64>,
    /// Root mean square error of the photometric frames on the wall, millimetres; null without true
    /// poses. The error of all frames is in [`Report::comparison`].
    pub error_wall_mm: Option<f64>,
    /// Root mean square error of the photometric frames on the wall, pixels of the frames.
    pub error_wall_px: Option<f64>,
}

/// Abscissa of frames in charts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Abscissa {
    /// Chainage of the refined poses, which is monotonic.
    Chainage,
    /// Index of the frame: the camera stood still, or moved back and forth.
    Frame,
}

/// Poses of one frame. Initial and refined poses are those of their files. The true poses are
/// aligned with the refined ones by the gauge of the tunnel (rotation about the axis, shift along
/// it).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FrameRow {
    /// Index of the frame.
    pub index: usize,
    /// Name of its file.
    pub file: String,
    /// Time, seconds.
    pub time_s: f64,
    /// Position of the initial pose.
    #[serde(rename = "planned_m")]
    pub initial_m: [f64; 3],
    /// Position of the refined pose; the second coordinate is its chainage.
    pub refined_m: [f64; 3],
    /// Position of the true pose.
    pub true_m: Option<[f64; 3]>,
    /// Rotation vector from the initial to the refined pose, about the camera's axes.
    pub correction_rotation_deg: [f64; 3],
    /// Rotation vector from the initial to the true pose.
    pub true_rotation_deg: Option<[f64; 3]>,
    /// Length of [`FrameRow::correction_rotation_deg`].
    pub correction_angle_deg: f64,
    /// Distance from the initial to the refined position.
    pub correction_distance_m: f64,
    /// 1-σ of the refined rotation about the camera's axes, relative to the first frame.
    pub sigma_rotation_deg: Option<[f64; 3]>,
    /// 1-σ of the refined position, relative to the first frame.
    pub sigma_translation_m: Option<[f64; 3]>,
}

/// Panoramas of the same part of the wall, long ones cut into strips.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PanoramaStrips {
    /// Orientation of the strips.
    pub layout: Layout,
    /// Resolution of the strips, pixels per metre.
    pub px_per_metre: f64,
    /// Chainage of their beginning and end.
    pub chainage_m: [f64; 2],
    /// Panorama of the initial poses, in the order of the chainage.
    pub baseline: Vec<Strip>,
    /// Panorama of the refined poses.
    pub refined: Vec<Strip>,
    /// Panorama of the true poses.
    pub truth: Option<Vec<Strip>>,
}

/// Picture of a part of the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strip {
    /// Its file in `report_pictures`.
    pub file: String,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
}

/// Maps of the wall. Lists are row-major: a row for each cell along the axis, which begins at
/// θ = 0.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WallMaps {
    /// Number of cells around the section.
    pub around: usize,
    /// Number of cells along the axis.
    pub along: usize,
    /// Chainage of the first cell's beginning and of the last one's end.
    pub chainage_m: [f64; 2],
    /// Root mean square difference of two frames with the initial poses, grey levels; null where no
    /// two frames overlap.
    pub baseline_grey: Vec<Option<f64>>,
    /// Root mean square difference with the refined poses, grey levels.
    pub refined_grey: Vec<Option<f64>>,
    /// Root mean square difference with the true poses, grey levels.
    pub true_grey: Option<Vec<Option<f64>>>,
    /// Mean number of frames that see a point of the cell with the refined poses.
    pub refined_frames: Vec<f64>,
}

/// Thumbnail of a flagged frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Thumbnail {
    /// Index of the frame.
    pub frame: usize,
    /// Its file in `report_pictures`.
    pub file: String,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
}
