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

    /// An error of the whole file.
    pub fn file(path: &Path, what: impl Into<String>) -> Self {
        Self::File {
            path: path.to_owned(),
            what: what.into(),
        }
    }
}
