//! Why a survey cannot be used.

use crate::camera::CalibrationError;
use crate::frames::FrameError;
use crate::surface::SurfaceError;
use crate::trajectory::PoseError;
use std::path::PathBuf;

/// Why a survey cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// `survey.toml` cannot be read.
    #[error("{}: cannot read the survey: {source}; a survey is a folder with a survey.toml", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// `survey.toml` is malformed or has an unknown key.
    #[error("{}:{line}:{column}: {what}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// What the parser said.
        what: String,
    },
    /// A value is impossible.
    #[error("{}: {what}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Which, and what it should be.
        what: String,
    },
    /// Frames and poses do not pair up.
    #[error(
        "{}: {poses} poses for {frames} frames; every frame needs exactly one pose, in the order of the frames' names{remedy}",
        path.display()
    )]
    Count {
        /// The pose file.
        path: PathBuf,
        /// Poses found.
        poses: usize,
        /// Frames found.
        frames: usize,
        /// What else could be done.
        remedy: &'static str,
    },
    /// Poses cannot be tied to frames, or not be understood.
    #[error("{}: {what}", path.display())]
    Association {
        /// The pose file.
        path: PathBuf,
        /// What is wrong, and the remedy.
        what: String,
    },
    /// A frame's time is needed and not known.
    #[error(
        "frame {frame} ({}): its name tells no time (seconds with a decimal point, or nanoseconds); give a file of times by \
         --frame-times FILE (frames.times in survey.toml)",
        file.display()
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
    /// A pose does not go with the tunnel.
    #[error("{}: frame {frame}: {source}; {remedy}", path.display())]
    Placement {
        /// The pose file.
        path: PathBuf,
        /// Index of the frame.
        frame: usize,
        /// What is wrong.
        source: SurfaceError,
        /// What might be.
        remedy: String,
    },
    /// The tunnel's own size.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// Calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Frames.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// Poses, times, or a rigid motion.
    #[error(transparent)]
    Poses(#[from] PoseError),
}
