//! Errors of parsers, with their place in the file.

use super::error::JobError;
use crate::files::line_and_column;
use std::path::Path;

/// The error of a TOML file of this content.
pub fn of_toml(path: &Path, text: &str, error: &toml::de::Error) -> JobError {
    let at = error.span().map_or(0, |span| span.start);
    let [line, column] = line_and_column(text, at);
    JobError::Parse {
        path: path.to_owned(),
        line,
        column,
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
