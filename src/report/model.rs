//! `report.json`.
//!
//! Lengths are metres, angles degrees, grey values those of an 8-bit picture; names say so. Numbers
//! that do not exist (no truth, no covariance) are null or missing. Lists of frames are in the
//! order of the survey.

use super::refined::Refinement;
use crate::evaluate::Comparison;
use crate::render::Layout;
use serde::{Deserialize, Serialize};

/// Version of the schema of `report.json`. It grows when a name, a unit or a meaning changes, not
/// when something is added.
pub const SCHEMA_VERSION: u32 = 1;

/// All that the page says.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Report {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name and version of the program.
    pub program: String,
    /// The command lines that led here, in their order: that of refine, if known, and that of the
    /// report.
    pub commands: Vec<Vec<String>>,
    /// What was surveyed.
    pub survey: SurveyFacts,
    /// The result in a few numbers.
    pub verdict: Verdict,
    /// What the charts' frames are spread along.
    pub abscissa: Abscissa,
    /// The poses, frame by frame.
    pub frames: Vec<FrameRow>,
    /// Initial against refined poses, as in `compare.json`.
    pub comparison: Comparison,
    /// The pictures of the unrolled wall.
    pub panoramas: PanoramaStrips,
    /// Where on the wall frames agree, and how many see it.
    pub wall: WallMaps,
    /// Small pictures of flagged frames, the first of them.
    pub thumbnails: Vec<Thumbnail>,
    /// What refine says; null for poses from elsewhere.
    pub refinement: Option<Refinement>,
    /// What a reader must know of the sources.
    pub notes: Vec<String>,
}

/// What was surveyed.
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
    /// Whether true poses are known.
    pub truth: bool,
    /// `survey.toml` as it is now.
    pub file: serde_json::Map<String, serde_json::Value>,
    /// The camera.
    pub camera: serde_json::Map<String, serde_json::Value>,
}

/// The result in a few numbers; residuals and errors against the truth are in
/// [`Report::comparison`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Verdict {
    /// Frames whose pose rests on their pixels; null if refine's report is missing.
    pub repaired: Option<usize>,
    /// Frames whose pose rests on the prior, or that fit two places.
    pub flagged: Option<usize>,
    /// Median angle by which a frame was turned, degrees.
    pub correction_rotation_deg: f64,
    /// Median distance by which a frame was moved, metres.
    pub correction_translation_m: f64,
    /// Median 1-σ of the repaired frames on the wall, millimetres.
    pub sigma_wall_mm: Option<f64>,
    /// The same in pixels of the frames.
    pub sigma_wall_px: Option<f64>,
    /// Root mean square error of the repaired frames on the wall, millimetres; null without truth.
    /// That of all frames is in [`Report::comparison`].
    pub error_wall_mm: Option<f64>,
    /// The same in pixels of the frames.
    pub error_wall_px: Option<f64>,
}

/// What frames are spread along in charts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Abscissa {
    /// The chainage of the refined poses, which never turns back.
    Chainage,
    /// The number of the frame: the camera stood still, or went back and forth.
    Frame,
}

/// The poses of one frame. Initial and refined ones are as in their files; the true one is moved
/// along the tunnel's gauge (turn about the axis, shift along it) so that all true poses lie as
/// close to the refined ones as they go.
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
    pub planned_m: [f64; 3],
    /// Position of the refined pose; the second is its chainage.
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

/// Panoramas of the same stretch of wall, cut where they are long.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PanoramaStrips {
    /// How they lie.
    pub layout: Layout,
    /// Resolution of the strips, pixels per metre.
    pub px_per_metre: f64,
    /// Chainage of their beginning and end.
    pub chainage_m: [f64; 2],
    /// From the initial poses, in the order of the chainage.
    pub baseline: Vec<Strip>,
    /// From the refined poses.
    pub refined: Vec<Strip>,
    /// From the true poses.
    pub truth: Option<Vec<Strip>>,
}

/// A picture of a stretch of the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strip {
    /// Its file in `report_pictures`.
    pub file: String,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
}

/// Measures of the wall, cell by cell. Lists hold a row for each stretch of the axis, from θ = 0
/// on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WallMaps {
    /// Cells around the section.
    pub around: usize,
    /// Cells along the axis.
    pub along: usize,
    /// Chainage of the first cell's beginning and of the last one's end.
    pub chainage_m: [f64; 2],
    /// Root mean square difference of two frames with the initial poses, grey levels; null where no
    /// two overlap.
    pub baseline_grey: Vec<Option<f64>>,
    /// With the refined poses.
    pub refined_grey: Vec<Option<f64>>,
    /// With the true poses.
    pub true_grey: Option<Vec<Option<f64>>>,
    /// Frames that see a point of the cell with the refined poses, on average.
    pub refined_frames: Vec<f64>,
}

/// A small picture of a flagged frame.
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
