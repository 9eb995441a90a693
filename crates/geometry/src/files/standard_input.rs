//! Standard input as a file, where a command names it by `-`.
//!
//! Its stream is kept in a temporary file without a name, so that readers may look at the beginning
//! first, and every opening begins at its start.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The path by which files open it: absolute, so that it means the same in every folder.
const PATH: &str = "/dev/stdin";
/// The name in messages.
const NAME: &str = "standard input";

/// The stream, from when a command names it.
static STREAM: Mutex<Stream> = Mutex::new(Stream::Unnamed);

/// The state of the stream.
enum Stream {
    /// No command names it: a path like [`PATH`] in a file of others is a device.
    Unnamed,
    /// It is still to be read.
    Named,
    /// All of it.
    Kept(File),
}

/// The path for a word of the command line: that of standard input for `-`, which may be opened
/// from now on.
pub fn path_or_standard_input(word: &OsStr) -> PathBuf {
    if word != "-" {
        return word.into();
    }
    let mut stream = STREAM.lock().unwrap_or_else(PoisonError::into_inner);
    if matches!(*stream, Stream::Unnamed) {
        *stream = Stream::Named;
    }
    PATH.into()
}

/// True for the path of standard input, if a command names it.
pub fn is_standard_input(path: &Path) -> bool {
    let stream = STREAM.lock().unwrap_or_else(PoisonError::into_inner);
    path == Path::new(PATH) && !matches!(*stream, Stream::Unnamed)
}

/// The name in messages, if a path is that of standard input.
pub(super) fn name_of(path: &Path) -> Option<&'static str> {
    is_standard_input(path).then_some(NAME)
}

/// Opens all that standard input has, at its start.
///
/// # Errors
/// An error of the operating system.
pub(super) fn open() -> io::Result<File> {
    let mut stream = STREAM.lock().unwrap_or_else(PoisonError::into_inner);
    if !matches!(*stream, Stream::Kept(_)) {
        let mut kept = tempfile::tempfile()?;
        io::copy(&mut io::stdin().lock(), &mut kept)?;
        *stream = Stream::Kept(kept);
    }
    let mut copy = tempfile::tempfile()?;
    if let Stream::Kept(kept) = &mut *stream {
        kept.rewind()?;
        io::copy(kept, &mut copy)?;
        copy.rewind()?;
    }
    Ok(copy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_paths_are_files() {
        assert_eq!(
            path_or_standard_input(OsStr::new("a.tum")),
            PathBuf::from("a.tum")
        );
        // Nothing named it.
        assert!(!is_standard_input(Path::new(PATH)));
        assert_eq!(name_of(Path::new("-")), None);
    }
}
