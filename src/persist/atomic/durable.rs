//! What is to outlast a power failure.

use rayon::prelude::*;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Puts what is in files on the disk, and that they are there.
///
/// # Errors
/// Whatever the system says of a file.
pub(crate) fn sync_files(files: &[PathBuf]) -> io::Result<()> {
    // Several at a time share what a disk does for one.
    files.par_iter().try_for_each(|path| {
        // Some systems ask for one that may be written.
        File::options().write(true).open(path)?.sync_all()
    })?;
    let mut folders: Vec<&Path> = files
        .iter()
        .map(|path| crate::persist::atomic::parent_folder(path))
        .collect();
    folders.sort_unstable();
    folders.dedup();
    folders.into_iter().for_each(sync_folder);
    Ok(())
}

/// The same for all that is in a folder.
///
/// # Errors
/// Whatever the system says.
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

/// Puts on the disk which files are in a folder, where the system can.
pub(super) fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        // Not all file systems do; what is in the files is safe already.
        let _ = folder.sync_all();
    }
}
