//! Synchronisation of files and folders to disk, to survive power failures.

use super::parent::parent_folder;
use rayon::prelude::*;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Synchronises files and their folder entries to disk.
///
/// # Errors
/// An error of the operating system about a file.
pub fn sync_files(files: &[PathBuf]) -> io::Result<()> {
    // Concurrent requests share the disk's flush.
    files.par_iter().try_for_each(|path| {
        // Some systems require write access.
        File::options().write(true).open(path)?.sync_all()
    })?;
    let mut folders: Vec<&Path> = files.iter().map(|path| parent_folder(path)).collect();
    folders.sort_unstable();
    folders.dedup();
    folders.into_iter().for_each(sync_folder);
    Ok(())
}

/// Synchronises all files of a folder to disk.
///
/// # Errors
/// An error of the operating system.
pub(super) fn sync_tree(folder: &Path) -> io::Result<()> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder)? {
            let entry = entry?;
            if entry.file_type()?.is_dir() {
                folders.push(entry.path())
            } else {
                files.push(entry.path())
            }
        }
        sync_folder(&folder);
    }
    sync_files(&files)
}

/// Synchronises the entries of a folder to disk, if the file system supports it.
pub(super) fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        // Not all file systems support it; the content of the files is on disk already.
        let _ = folder.sync_all();
    }
}
