//! Text files of jobs: errors of parsers with their place in the file, and JSON.

use super::error::JobError;
use crate::files::line_and_column;
use crate::persist::atomic::{self, WriteError};
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// The error of a TOML file of this content.
pub fn toml_error(path: &Path, text: &str, error: &toml::de::Error) -> JobError {
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
pub fn json_error(path: &Path, error: &serde_json::Error) -> JobError {
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

/// Writes a value as indented JSON with a trailing line break; the folder is created if missing.
///
/// # Errors
/// A file that cannot be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    atomic::write(path, |writer| {
        serde_json::to_writer_pretty(&mut *writer, value)?;
        writer.write_all(b"\n")
    })
}
