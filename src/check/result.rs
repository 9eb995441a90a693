//! Result of the check of a survey.

use super::deformation::DeformationCheck;
use super::effort::Effort;
use super::jitter::JitterCheck;
use super::masks::MaskCheck;
use super::overlap::OverlapCheck;
use super::pictures::PictureCheck;
use super::poses::PosesCheck;
use crate::frames::Mask;
use crate::refine::FittingReadings;
use crate::survey::OverlayReport;
use serde::Serialize;

/// Result of the check of a survey.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Check {
    /// Number of frames.
    pub frames: usize,
    /// Width and height of the frames according to the calibration, pixels.
    pub size_px: [u32; 2],
    /// Share of the image that the lens covers, 0–1.
    pub shown_share: f64,
    /// Parts of image and wall that are left out.
    pub masks: MaskCheck,
    /// Pixels that do not move with the wall, and interlacing.
    pub overlay: OverlayReport,
    /// The mask that hides these pixels and those of the survey's mask; none if all show the wall.
    #[serde(skip)]
    pub proposed_mask: Option<Mask>,
    /// Positions and steps of the initial poses.
    pub poses: PosesCheck,
    /// Overlap of neighbours and of turns.
    pub overlap: OverlapCheck,
    /// Median resolution of the frames at the wall, pixels per metre.
    pub px_per_metre: f64,
    /// Expected errors of the initial poses.
    pub jitter: JitterCheck,
    /// Exposure, noise and texture of the frames.
    pub pictures: PictureCheck,
    /// Deformation of the wall that can be measured; None if the wall is said to be exact, or if
    /// there is no texture or no overlap.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deformation: Option<DeformationCheck>,
    /// Time and memory that refining and stitching need.
    pub effort: Effort,
    /// Other readings of poses and pictures, if neighbouring frames agree with them only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub readings: Option<FittingReadings>,
    /// Faults that make `refine` or `stitch` fail, each with its remedy.
    pub faults: Vec<String>,
    /// Conditions that need attention, each with its remedy.
    pub warnings: Vec<String>,
}
