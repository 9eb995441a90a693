//! Errors of frames.

use std::path::PathBuf;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::recordings::RecordingError;

/// An error of a frame, a video or a mask.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The pattern in survey.toml is malformed.
    #[error("frames.images = \"{pattern}\": {what}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// The problem.
        what: String,
    },
    /// The pattern matches nothing.
    #[error(
        "frames.images = \"{pattern}\" matches no file; the pattern is relative to survey.toml"
    )]
    NoFrames {
        /// The pattern.
        pattern: String,
    },
    /// A frame is unreadable or damaged.
    #[error("frame {index} ({}): {what}; {remedy}", printed(path))]
    Decode {
        /// Index of the frame in the survey.
        index: usize,
        /// The file.
        path: PathBuf,
        /// The error of the decoder.
        what: String,
        /// The remedy.
        remedy: String,
    },
    /// A video cannot be read.
    #[error("{}: {what}", printed(path))]
    Video {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        what: String,
    },
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A mask is unreadable or invalid.
    #[error("{}: {what}", printed(path))]
    Mask {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        what: String,
    },
    /// A frame's size differs from the calibration's.
    #[error(
        "frame {index} ({}): {width} × {height} px, but the calibration is for {expected_width} × \
         {expected_height} px; give the calibration of these frames, or leave out what cannot be \
         read by --skip-bad (skip_bad = true under [frames])",
        printed(path)
    )]
    Size {
        /// Index of the frame in the survey.
        index: usize,
        /// The file.
        path: PathBuf,
        /// Width found.
        width: u32,
        /// Height found.
        height: u32,
        /// Width of the calibration.
        expected_width: u32,
        /// Height of the calibration.
        expected_height: u32,
    },
}

impl FrameError {
    /// The reason of the failure, without the name of the frame and the remedy.
    pub fn reason(&self) -> String {
        match self {
            Self::Decode { what, .. } => what.clone(),
            Self::Size {
                width,
                height,
                expected_width,
                expected_height,
                ..
            } => format!("{width} × {height} px, not {expected_width} × {expected_height} px"),
            _ => self.to_string(),
        }
    }
}
