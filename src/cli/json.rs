//! Results for programs, on standard output.

use super::Failure;
use crate::persist::atomic::WriteError;
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// Prints a value as indented JSON with a line break at its end.
///
/// # Errors
/// A standard output that is full.
pub fn print(value: &impl Serialize) -> Result<(), Failure> {
    print_text(&text(value)?)
}

/// Prints JSON that is text already.
///
/// # Errors
/// As [`print()`].
pub fn print_text(text: &str) -> Result<(), Failure> {
    match std::io::stdout().write_all(text.as_bytes()) {
        // A reader that has left (`| head`) is no error.
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(WriteError::new(Path::new("standard output"), error).into())
        }
        _ => Ok(()),
    }
}

/// A value as indented JSON with a line break at its end.
///
/// # Errors
/// A value that has no JSON, which is a bug.
pub fn text(value: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string_pretty(value)
        .map(|text| text + "\n")
        .map_err(|error| Failure::bug(format!("cannot make JSON of the result: {error}")))
}
