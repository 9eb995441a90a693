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
    /// The file is of another kind: no calibration known here.
    #[error("{}: {what}", printed(path))]
    OtherKind {
        /// The file.
        path: PathBuf,
        /// The kinds that are known.
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
    pub kind: ParseErrorKind,
}

/// A kind of error of a parser.
#[derive(Debug, Default, PartialEq)]
pub(super) enum ParseErrorKind {
    /// The content is invalid.
    #[default]
    Content,
    /// The file is no calibration known here.
    OtherKind,
    /// One of several cameras, of these names, is to be selected.
    Several(Vec<String>),
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
