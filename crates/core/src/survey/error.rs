//! Errors of surveys.

use crate::frames::FrameError;
use crate::points::PointsError;
use crate::storage::StorageError;
use std::path::PathBuf;
use tunnelstitch_geometry::camera::CalibrationError;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::surface::SurfaceError;
use tunnelstitch_geometry::trajectory::PoseError;

/// An error of a survey.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// `survey.toml` cannot be read.
    #[error(
        "{}: cannot read the survey: {source}; a survey is a folder with a survey.toml",
        printed(path)
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file of the initial poses is not there.
    #[error(
        "{}: there is no such file of initial poses; name one by initial = \"…\" under [poses], or \
         let tunnelstitch plan or tunnelstitch gyro make it (tunnelstitch init --force says why it \
         took no other file for poses)",
        printed(path)
    )]
    NoInitialPoses {
        /// The file.
        path: PathBuf,
    },
    /// `survey.toml` is malformed or has an unknown key.
    #[error("{}:{line}:{column}: {what}", printed(path))]
    Parse {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// The error of the parser.
        what: String,
    },
    /// A value is impossible.
    #[error("{}: {what}", printed(path))]
    Value {
        /// The file.
        path: PathBuf,
        /// The value and its valid range.
        what: String,
    },
    /// Frames on storage cannot be fetched.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// Measured points cannot be read.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// The numbers of frames and poses differ.
    #[error(
        "{}: {poses} poses for {frames} frames; every frame needs exactly one pose, in the order \
         of the frames' names{remedy}",
        printed(path)
    )]
    Count {
        /// The pose file.
        path: PathBuf,
        /// Poses found.
        poses: usize,
        /// Frames found.
        frames: usize,
        /// Another remedy.
        remedy: String,
    },
    /// Poses cannot be associated with frames, or their convention is unknown.
    #[error("{}: {what}", printed(path))]
    Association {
        /// The pose file.
        path: PathBuf,
        /// The problem and the remedy.
        what: String,
    },
    /// A frame's time is needed, but unknown.
    #[error(
        "frame {frame} ({}): its name contains no time (seconds with a decimal point, or the \
         digits of a time since 1970; time_unit under [frames] names another unit); give a file \
         of times by --frame-times FILE (frames.times in survey.toml)",
        printed(file)
    )]
    FrameTime {
        /// Index of the frame.
        frame: usize,
        /// The frame.
        file: PathBuf,
    },
    /// There is no frame.
    #[error("there is no frame")]
    NoFrame,
    /// Times of the frames do not increase.
    #[error(
        "frame {frame} has time {time_s} s, and the one before it {previous_s} s; times must \
         increase in the order of the frames"
    )]
    FrameTimeOrder {
        /// Index of the later frame.
        frame: usize,
        /// Its time, seconds.
        time_s: f64,
        /// Time of the frame before it, seconds.
        previous_s: f64,
    },
    /// A pose is impossible in the tunnel.
    #[error("{}: frame {frame}: {source}; {remedy}", printed(path))]
    Placement {
        /// The pose file.
        path: PathBuf,
        /// Index of the frame.
        frame: usize,
        /// The problem.
        source: SurfaceError,
        /// A probable cause.
        remedy: String,
    },
    /// An error of the tunnel's shape.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// An error of the calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// An error of the frames.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// An error of poses, times, or a rigid motion.
    #[error(transparent)]
    Poses(#[from] PoseError),
}
