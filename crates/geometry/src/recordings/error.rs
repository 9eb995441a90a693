//! Errors of recordings.

use crate::files::printed;
use std::path::{Path, PathBuf};

/// An error of a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{}: cannot read the recording: {source}", printed(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The content is damaged, cut off, or not what is asked for.
    #[error("{}: {what}", printed(path))]
    Content {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        what: String,
    },
}

impl RecordingError {
    /// An error of the content.
    pub(super) fn content(path: &Path, what: impl Into<String>) -> Self {
        Self::Content {
            path: path.to_owned(),
            what: what.into(),
        }
    }

    /// An error of the operating system.
    pub(super) fn unreadable(path: &Path, source: std::io::Error) -> Self {
        Self::Read {
            path: path.to_owned(),
            source,
        }
    }

    /// The problem, without the name of the file.
    pub fn reason(&self) -> String {
        match self {
            Self::Read { source, .. } => source.to_string(),
            Self::Content { what, .. } => what.clone(),
        }
    }
}
