//! Errors of calibration files.

use std::path::PathBuf;

/// Why a calibration file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The file cannot be read.
    #[error("{}: cannot read the calibration: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file does not hold what it should.
    #[error("{}:{}{what}", path.display(), line_prefix(*line))]
    Content {
        /// The file.
        path: PathBuf,
        /// The line, from 1, where it is known.
        line: Option<usize>,
        /// What is wrong, and what to do.
        what: String,
    },
}

fn line_prefix(line: Option<usize>) -> String {
    line.map_or(" ".to_owned(), |line| format!("{line}: "))
}

/// What a parser found wrong, and in which line.
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
