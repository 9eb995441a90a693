//! `-` as the name of a file: standard input or standard output.

use super::failure::Failure;
use super::json::print_bytes;
use super::terminal::Terminal;
use crate::persist::atomic::WriteError;
use std::path::Path;

/// True for `-`, the name of standard input or standard output.
pub fn is_stream(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Refuses standard output for a file where it has the result as JSON.
///
/// # Errors
/// `--out -` together with `--json`.
pub fn refuse_two_results(out: &Path, terminal: &Terminal) -> Result<(), Failure> {
    if is_stream(out) && terminal.is_json() {
        return Err(Failure::usage(
            "--out - and --json would both print on standard output; name a file, or leave out \
             --json",
        ));
    }
    Ok(())
}

/// Writes the content of a file on standard output.
///
/// # Errors
/// A file that cannot be read; a standard output that is full.
pub fn print_file(path: &Path) -> Result<(), Failure> {
    let bytes = std::fs::read(path).map_err(|source| WriteError::new(path, source))?;
    print_bytes(&bytes)
}
