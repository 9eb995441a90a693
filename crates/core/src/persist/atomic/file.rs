//! Files under a temporary name, and folders for them.

use super::error::WriteError;
use super::error_keeper::ErrorKeeper;
use super::parent::parent_folder;
use super::temporary::{self, TemporaryFile};
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use tunnelstitch_geometry::files::check_replaceable_file;

/// Writes the content of the file `path` to a temporary file beside it, in a folder that is created
/// if it is missing.
///
/// # Errors
/// An error of the operating system about the folder or writing.
pub(super) fn fill_temporary(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<ErrorKeeper<File>>) -> std::io::Result<()>,
) -> Result<TemporaryFile, WriteError> {
    let fail = |source| WriteError::new(path, source);
    create_folder(parent_folder(path))?;
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
    refuse_file(path)?;
    // Held, so that a temporary folder that an interruption has removed is not created anew.
    let _uninterrupted = temporary::hold_list();
    std::fs::create_dir_all(path).map_err(|source| WriteError::new(path, source))
}

/// Checks that files can be written into a folder that exists or can be created; creates nothing.
///
/// # Errors
/// An error of the operating system; a file of that name.
pub fn check_folder(path: &Path) -> Result<(), WriteError> {
    refuse_file(path)?;
    let is_there = |folder: &&Path| folder.symlink_metadata().is_ok();
    let existing = path.ancestors().find(is_there);
    let writable = check_writable(existing.unwrap_or(Path::new(".")));
    writable.map_err(|source| WriteError::new(path, source))
}

fn refuse_file(path: &Path) -> Result<(), WriteError> {
    if path.is_file() {
        let what = std::io::Error::other("it is a file, and a folder is needed");
        return Err(WriteError::new(path, what));
    }
    Ok(())
}

/// Checks that an existing path is a folder in which this process may create files.
fn check_writable(folder: &Path) -> std::io::Result<()> {
    if !folder.metadata()?.is_dir() {
        return Err(std::io::ErrorKind::NotADirectory.into());
    }
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    {
        use rustix::fs::{Access, access};
        access(folder, Access::WRITE_OK | Access::EXEC_OK)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_checked_without_being_created() {
        let dir = tempfile::tempdir().unwrap();
        let (new, file) = (dir.path().join("a").join("b"), dir.path().join("file"));
        check_folder(dir.path()).unwrap();
        check_folder(&new).unwrap();
        check_folder(Path::new("new/folder")).unwrap();
        assert!(!dir.path().join("a").exists());
        std::fs::write(&file, "").unwrap();
        let message = |path: &Path| check_folder(path).unwrap_err().to_string();
        assert_eq!(
            message(&file),
            create_folder(&file).unwrap_err().to_string()
        );
        let below = file.join("folder");
        assert!(
            message(&below).contains("not a directory"),
            "{}",
            message(&below)
        );
    }

    #[test]
    fn missing_folders_of_a_file_are_created() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a").join("b.txt");
        let mut set = super::super::output_set::OutputSet::default();
        set.write_text(&path, "text").unwrap();
        set.commit().unwrap();
        assert_eq!(std::fs::read_to_string(path).unwrap(), "text");
    }
}
