//! Files under a temporary name, and folders for them.

use super::error::WriteError;
use super::error_keeper::ErrorKeeper;
use super::parent::parent_folder;
use super::temporary::{self, TemporaryFile};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use tunnelstitch_geometry::files::check_replaceable_file;

/// Writes the content of the file `path` to a temporary file beside it.
///
/// # Errors
/// An error of the operating system about the folder or writing.
pub(super) fn fill_temporary(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<ErrorKeeper<File>>) -> std::io::Result<()>,
) -> Result<TemporaryFile, WriteError> {
    let fail = |source| WriteError::new(path, source);
    check_replaceable_file(path).map_err(fail)?;
    let temporary = temporary::file_in(parent_folder(path)).map_err(fail)?;
    let file = temporary.file.try_clone().map_err(fail)?;
    let mut writer = BufWriter::new(ErrorKeeper::new(file));
    let filled = fill(&mut writer);
    // The cause, if the writer was an encoder with errors of its own.
    let error = writer.get_mut().error.take();
    filled.map_err(|other| fail(error.unwrap_or(other)))?;
    writer
        .into_inner()
        .map_err(|error| fail(error.into_error()))?;
    // Files in an unfinished folder are synchronised together with the folder.
    if !temporary::is_unfinished(path) {
        temporary.file.sync_all().map_err(fail)?;
    }
    Ok(temporary)
}

/// Removes a file, if it exists.
///
/// # Errors
/// An error of the operating system.
pub fn remove_file(path: &Path) -> Result<(), WriteError> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(WriteError::new(path, error))
        }
        _ => Ok(()),
    }
}

/// Creates a folder and its parents.
///
/// # Errors
/// An error of the operating system; a file of that name.
pub fn create_folder(path: &Path) -> Result<(), WriteError> {
    if path.is_file() {
        let what = std::io::Error::other("it is a file, and a folder is needed");
        return Err(WriteError::new(path, what));
    }
    std::fs::create_dir_all(path).map_err(|source| WriteError::new(path, source))
}
