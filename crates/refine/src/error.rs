//! Reasons why a survey cannot be refined.

use crate::model::problem_error::ProblemError;
use crate::points::error::PointsFitError;
use tunnelstitch_core::survey::SurveyError;

/// A reason why frames cannot be refined.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RefineError {
    /// Nothing to compare with.
    #[error(
        "the survey has a single frame; refinement compares frames that overlap on the wall, so it \
         needs two or more"
    )]
    SingleFrame,
    /// Poses without motion.
    #[error(
        "all {frames} initial poses are equal, so that they say nothing about where the frames \
         lie; give the motion of the camera: `tunnelstitch plan` writes poses from the advance and \
         the angle of a step, `tunnelstitch gyro` from the log of a gyroscope"
    )]
    NoMotion {
        /// Number of frames.
        frames: usize,
    },
    /// Frames and poses do not correspond.
    #[error("{frames} frames, but {poses} initial poses; give one pose for each frame, in order")]
    PoseCount {
        /// Number of frames.
        frames: usize,
        /// Number of initial poses.
        poses: usize,
    },
    /// A stretch that there is not.
    #[error(
        "there is no shard {number} of {of} of a survey of {frames} frames; they are counted from \
         1, and each needs a frame of every camera"
    )]
    NoShard {
        /// The number asked for.
        number: usize,
        /// Number of stretches.
        of: usize,
        /// Number of frames.
        frames: usize,
    },
    /// Stretches that do not make up the survey.
    #[error(
        "the shards to be joined are not all of the survey, each once, in order: {what}; refine \
         every shard of the same number of shards"
    )]
    ShardsIncomplete {
        /// The difference.
        what: String,
    },
    /// Neighbouring stretches that contradict each other.
    #[error(
        "shards {number} and {} place frames {first} to {last}, which they share, {distance_px:.1} \
         px apart, so one of them is wrong; divide the survey elsewhere (another number of \
         shards), or refine it as one",
        number + 1
    )]
    ShardsDisagree {
        /// The first of the two, from 1.
        number: usize,
        /// First frame that both have placed.
        first: usize,
        /// Last frame that both have placed.
        last: usize,
        /// Median distance of their places, pixels.
        distance_px: f64,
    },
    /// Stretches of different light.
    #[error(
        "the light fits no model in {normalised} of {of} shards, and does in the others; give \
         photometry = \"normalised\" under [options.refine] of survey.toml, and refine the shards \
         anew"
    )]
    LightOfShards {
        /// Number of stretches without a model.
        normalised: usize,
        /// Number of stretches.
        of: usize,
    },
    /// Nothing overlaps.
    #[error(
        "no two frames overlap on the wall by as much as a tile, according to the initial poses, \
         the tunnel, the calibration and the masks"
    )]
    NoOverlap,
    /// Something that is known by its shape only for a straight round tunnel.
    #[error(
        "{unknown} can be estimated of a straight round tunnel only; leave it out of --calibrate \
         and [calibrate] unknowns"
    )]
    OnlyRound {
        /// The parameter that was to be estimated.
        unknown: &'static str,
    },
    /// The lens of a rig.
    #[error(
        "the cameras of a rig are taken as calibrated; leave focal, centre and distortion out of \
         --calibrate and [calibrate] unknowns"
    )]
    LensOfRig,
    /// Something that measured points tell better than frames.
    #[error(
        "{unknown} is that of the measured points; leave it out of --calibrate and [calibrate] \
         unknowns, or refine without points"
    )]
    GivenByPoints {
        /// The parameter that was to be estimated.
        unknown: &'static str,
    },
    /// Measured points that do not fit the wall.
    #[error(transparent)]
    Points(#[from] PointsFitError),
    /// Poses that cannot be read in all readings.
    #[error(transparent)]
    Readings(#[from] Box<SurveyError>),
    /// The equations.
    #[error(transparent)]
    Problem(#[from] ProblemError),
}
