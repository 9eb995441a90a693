//! Results as JSON on standard output.

use super::failure::Failure;
use crate::persist::atomic::WriteError;
use serde::Serialize;
use std::io::Write;
use std::path::Path;

/// Prints a value as indented JSON with a trailing line break.
///
/// # Errors
/// A standard output that is full.
pub fn print(value: &impl Serialize) -> Result<(), Failure> {
    print_text(&text(value)?)
}

/// Prints a text that is JSON already.
///
/// # Errors
/// The errors of [`print()`].
pub fn print_text(text: &str) -> Result<(), Failure> {
    print_bytes(text.as_bytes())
}

/// Writes bytes on standard output.
///
/// # Errors
/// The errors of [`print()`].
pub(super) fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = std::io::stdout();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        // A closed pipe (`| head`) is not an error.
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(WriteError::new(Path::new("standard output"), error).into())
        }
        _ => Ok(()),
    }
}

/// Formats a value as indented JSON with a trailing line break.
///
/// # Errors
/// A value that cannot be serialised, which is a bug.
pub fn text(value: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string_pretty(value)
        .map(|text| text + "\n")
        .map_err(|error| Failure::bug(format!("cannot make JSON of the result: {error}")))
}
