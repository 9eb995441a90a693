//! Errors of files of points.

use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::printed;

/// A file of points that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PointsError {
    /// The file as a whole.
    #[error("{}: {what}", printed(path))]
    File {
        /// The file.
        path: PathBuf,
        /// The problem and its remedy.
        what: String,
    },
    /// A line of a text.
    #[error("{}:{line}: {what}", printed(path))]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The problem and its remedy.
        what: String,
    },
    /// A point of a binary file.
    #[error("{}: point {point}: {what}", printed(path))]
    Point {
        /// The file.
        path: PathBuf,
        /// The point, from 1.
        point: u64,
        /// The problem and its remedy.
        what: String,
    },
}

impl PointsError {
    /// The error of a file as a whole.
    pub(super) fn file(path: &Path, what: impl Into<String>) -> Self {
        Self::File {
            path: path.to_owned(),
            what: what.into(),
        }
    }

    /// The error of a line, counted from 1.
    pub(super) fn line(path: &Path, line: u64, what: impl Into<String>) -> Self {
        Self::Line {
            path: path.to_owned(),
            line,
            what: what.into(),
        }
    }

    /// The error of a point, counted from 1.
    pub(super) fn point(path: &Path, point: u64, what: impl Into<String>) -> Self {
        Self::Point {
            path: path.to_owned(),
            point,
            what: what.into(),
        }
    }
}
