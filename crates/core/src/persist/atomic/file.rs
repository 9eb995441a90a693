//! Files that are complete or absent.

use super::error::WriteError;
use super::error_keeper::ErrorKeeper;
use super::output_set::OutputSet;
use super::parent::parent_folder;
use super::temporary::{self, TemporaryFile};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use tunnelstitch_geometry::files::check_replaceable_file;

/// Writes the file `path` atomically; `fill` writes its content.
///
/// # Errors
/// An error of the operating system about the folder, writing or renaming.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<ErrorKeeper<File>>) -> std::io::Result<()>,
) -> Result<(), WriteError> {
    let mut set = OutputSet::default();
    set.write(path, fill)?;
    set.commit()
}

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

/// Writes a text file atomically; see [`write()`].
///
/// # Errors
/// The errors of [`write()`].
pub fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write(path, |writer| writer.write_all(text.as_bytes()))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_litter() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_text(&path, "old").unwrap();
        let failed = write(&path, |writer| {
            writer.write_all(b"new")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk full"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_error_of_the_system_is_the_one_reported() {
        let mut writer = ErrorKeeper::new(File::options().write(true).open("/dev/full").unwrap());
        let failed = writer
            .write_all(b"x")
            .map_err(|_| std::io::Error::other("encoder"));
        assert!(failed.is_err());
        assert_eq!(
            writer.error.unwrap().kind(),
            std::io::ErrorKind::StorageFull
        );
    }
}
