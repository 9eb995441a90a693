//! Errors of outputs.

use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::printed;

/// An output that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write: {source}", printed(path))]
pub struct WriteError {
    /// The file or folder.
    pub path: PathBuf,
    /// The error of the operating system.
    pub source: std::io::Error,
}

impl WriteError {
    /// Creates an error about `path`.
    pub fn new(path: &Path, source: std::io::Error) -> Self {
        Self {
            path: path.to_owned(),
            source,
        }
    }
}
