//! Errors of a report's sources.

use crate::files::printed;
use crate::frames::FrameError;
use crate::refine::CovarianceError;
use crate::render::RenderError;
use crate::survey::SurveyError;
use std::path::PathBuf;

/// Error of a report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The folder has no refined poses.
    #[error(
        "{}: holds no poses.tum; --refined is the folder that refine has written, or a TUM file",
        printed(path)
    )]
    NoPoses {
        /// The folder.
        path: PathBuf,
    },
    /// A file cannot be read.
    #[error("{}: cannot read it: {source}", printed(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// `refine.json` is malformed, or of another version.
    #[error(
        "{}:{line}:{column}: {what}; refine the survey again with this version",
        printed(path)
    )]
    Parse {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// Error of the parser.
        what: String,
    },
    /// `sections.csv` is malformed.
    #[error("{}: {what}; refine the survey again", printed(path))]
    Table {
        /// The file.
        path: PathBuf,
        /// Line and error.
        what: String,
    },
    /// `refine.json` is of another survey.
    #[error(
        "{}: has {found} frames, but the survey has {frames}; give the folder that refine has \
         written for this survey",
        printed(path)
    )]
    Count {
        /// The file.
        path: PathBuf,
        /// Frames in it.
        found: usize,
        /// Frames of the survey.
        frames: usize,
    },
    /// A picture cannot be encoded.
    #[error("{name}: cannot encode the picture: {source}")]
    Encode {
        /// Its name.
        name: String,
        /// Error of the encoder.
        source: image::ImageError,
    },
    /// The survey or its poses.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// Covariances.
    #[error(transparent)]
    Covariance(#[from] CovarianceError),
    /// Frames.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// Placement of the frames on the wall.
    #[error(transparent)]
    Render(#[from] RenderError),
}
