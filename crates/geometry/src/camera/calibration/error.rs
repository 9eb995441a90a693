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
    /// The file holds several cameras, and none is selected.
    #[error("{}: {what}", printed(path))]
    Several {
        /// The file.
        path: PathBuf,
        /// The names of its cameras.
        names: Vec<String>,
        /// The names and the remedy in words.
        what: String,
    },
}

fn line_prefix(line: Option<usize>) -> String {
    line.map_or(" ".to_owned(), |line| format!("{line}: "))
}

/// An error of a parser, with its line if known.
#[derive(Debug, Default, PartialEq)]
pub(super) struct ParseError {
    pub line: Option<usize>,
    pub what: String,
    /// The names of the cameras, if one of several is to be selected.
    pub names: Vec<String>,
}

impl ParseError {
    pub fn new(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            ..Self::default()
        }
    }

    pub fn at(line: usize, what: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            ..Self::new(what)
        }
    }
}

impl From<LensParameterError> for ParseError {
    fn from(error: LensParameterError) -> Self {
        Self::new(error.to_string())
    }
}
