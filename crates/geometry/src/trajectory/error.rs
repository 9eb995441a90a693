//! Errors of pose files.

use crate::files::printed;
use std::path::{Path, PathBuf};

/// An error of a file of poses, of frame times or of a rigid motion.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// The file cannot be read.
    #[error("{}: cannot read the file: {source}", printed(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A line is invalid.
    #[error("{}:{line}: {what}", printed(path))]
    Line {
        /// The file.
        path: PathBuf,
        /// 1-based number of the line.
        line: usize,
        /// The problem and the remedy.
        what: String,
    },
    /// The file is of another kind: in no known format, or without poses.
    #[error("{}:{}{what}", printed(path), line_prefix(*line))]
    OtherKind {
        /// The file.
        path: PathBuf,
        /// 1-based number of the line that is in no known format.
        line: Option<usize>,
        /// The problem, and the formats that are known.
        what: String,
    },
    /// The file as a whole is invalid.
    #[error("{}: {what}", printed(path))]
    File {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        what: String,
    },
}

impl PoseError {
    /// An error of one line.
    pub fn line(path: &Path, line: usize, what: impl Into<String>) -> Self {
        Self::Line {
            path: path.to_owned(),
            line,
            what: what.into(),
        }
    }

    /// The error of a file of a known format, or of a text without any line, that holds no poses.
    pub(super) fn no_poses(path: &Path) -> Self {
        Self::OtherKind {
            path: path.to_owned(),
            line: None,
            what: "holds no poses".to_owned(),
        }
    }

    /// An error of the whole file.
    pub fn file(path: &Path, what: impl Into<String>) -> Self {
        Self::File {
            path: path.to_owned(),
            what: what.into(),
        }
    }
}

fn line_prefix(line: Option<usize>) -> String {
    line.map_or(" ".to_owned(), |line| format!("{line}: "))
}
