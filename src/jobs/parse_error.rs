//! Errors of parsers, with their place in the file.

use super::error::JobError;
use std::path::Path;

/// The error of a TOML file of this content.
pub fn of_toml(path: &Path, text: &str, error: &toml::de::Error) -> JobError {
    let at = error.span().map_or(0, |span| span.start.min(text.len()));
    let before = &text.as_bytes()[..at];
    let line_start = before.iter().rposition(|byte| *byte == b'\n');
    JobError::Parse {
        path: path.to_owned(),
        line: 1 + before.iter().filter(|byte| **byte == b'\n').count(),
        column: at - line_start.map_or(0, |newline| newline + 1) + 1,
        what: error.message().replace('\n', " "),
    }
}

/// The error of a JSON file.
pub fn of_json(path: &Path, error: &serde_json::Error) -> JobError {
    let (line, column) = (error.line(), error.column());
    let what = error.to_string();
    let place = format!(" at line {line} column {column}");
    JobError::Parse {
        path: path.to_owned(),
        line,
        column,
        what: what.strip_suffix(&place).unwrap_or(&what).to_owned(),
    }
}
