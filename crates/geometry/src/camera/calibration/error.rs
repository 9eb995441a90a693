//! Errors of calibration files.

use crate::camera::lens_error::LensParameterError;
use crate::files::printed;
use std::path::PathBuf;

/// An error of a calibration file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The file cannot be read.
    #[error("{}: cannot read the calibration: {source}", printed(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The content is invalid.
    #[error("{}:{}{what}", printed(path), line_prefix(*line))]
    Content {
        /// The file.
        path: PathBuf,
        /// The line, from 1, if known.
        line: Option<usize>,
        /// The problem and the remedy.
        what: String,
    },
}

fn line_prefix(line: Option<usize>) -> String {
    line.map_or(" ".to_owned(), |line| format!("{line}: "))
}

/// An error of a parser, with its line if known.
#[derive(Debug, PartialEq)]
pub(super) struct ParseError {
    pub line: Option<usize>,
    pub what: String,
}

impl ParseError {
    pub fn new(what: impl Into<String>) -> Self {
        Self {
            line: None,
            what: what.into(),
        }
    }

    pub fn at(line: usize, what: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            what: what.into(),
        }
    }
}

impl From<LensParameterError> for ParseError {
    fn from(error: LensParameterError) -> Self {
        Self::new(error.to_string())
    }
}
