//! Temporary files and folders: listed and locked while in use, and removed if a killed program has
//! abandoned them.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tempfile::{TempDir, TempPath};

/// Prefix of temporary names.
const PREFIX: &str = ".tunnelstitch-";

/// End of the temporary name of a result that is being replaced in several steps. It is never
/// removed as abandoned: it may be the only copy.
pub(super) const REPLACED_SUFFIX: &str = ".replaced";

/// Temporary paths in use.
static UNFINISHED_PATHS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Folders from which this process has removed abandoned files.
static CLEANED_FOLDERS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Largest number of attempts to remove a folder.
const MAX_REMOVAL_ATTEMPTS: usize = 20;

/// Guard of an entry in the list of temporary paths.
struct Listed(PathBuf);

impl Listed {
    fn new(list: &mut Vec<PathBuf>, path: &Path) -> Self {
        list.push(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        let mut list = hold_list();
        list.retain(|path| *path != self.0);
    }
}

/// Removes every file and folder that is being written, for a program that is about to be
/// terminated. The writers are not notified and must not continue, so the list stays locked until
/// the process ends.
pub fn remove_unfinished() {
    let list = hold_list();
    for path in list.iter() {
        // A writer may still create a file in a folder while it is being removed.
        for _ in 0..MAX_REMOVAL_ATTEMPTS {
            // An error cannot be reported at this point.
            let _ = remove(path);
            if !path.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    std::mem::forget(list);
}

/// Holds the list of temporary paths, so that [`remove_unfinished`] waits until it is dropped. No
/// temporary file or folder can be created or dropped meanwhile.
pub(super) fn hold_list() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED_PATHS
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
}

/// True if `path` is, or lies in, a temporary path of this process.
pub(super) fn is_unfinished(path: &Path) -> bool {
    let list = hold_list();
    list.iter().any(|unfinished| path.starts_with(unfinished))
}

/// A temporary file, locked while open.
pub(super) struct TemporaryFile {
    /// The file.
    pub file: File,
    /// Its path; the file is removed on drop, unless it is renamed.
    pub path: TempPath,
    _listed: Listed,
}

/// Creates a temporary file in `folder`.
///
/// # Errors
/// An error of the operating system.
pub(super) fn file_in(folder: &Path) -> io::Result<TemporaryFile> {
    remove_abandoned(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The permissions of a new file; the system applies the process's umask.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    loop {
        // Held from before the file exists: an interruption in between would leave it.
        let mut list = hold_list();
        let (file, path) = builder.tempfile_in(folder)?.into_parts();
        if lock_new(&file, &path) {
            let _listed = Listed::new(&mut list, &path);
            return Ok(TemporaryFile {
                file,
                path,
                _listed,
            });
        }
    }
}

/// A temporary folder, locked during its lifetime.
pub(super) struct TemporaryFolder {
    /// The folder; it is removed on drop, unless it is kept.
    pub folder: TempDir,
    _listed: Listed,
    _lock: Option<File>,
}

/// Name of the new content in a temporary folder, and of the old one after an exchange.
const CONTENT: &str = "content";

impl TemporaryFolder {
    /// The place of the new content, and of the old one after an exchange.
    pub fn content(&self) -> PathBuf {
        self.folder.path().join(CONTENT)
    }
}

/// Creates a temporary folder in `parent`.
///
/// # Errors
/// An error of the operating system.
pub(super) fn folder_in(parent: &Path) -> io::Result<TemporaryFolder> {
    remove_abandoned(parent);
    loop {
        // As in `file_in`.
        let mut list = hold_list();
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent)?;
        // Some systems cannot open folders; there, folders are never removed as abandoned either.
        let lock = File::open(folder.path()).ok();
        if lock
            .as_ref()
            .is_none_or(|lock| lock_new(lock, folder.path()))
        {
            return Ok(TemporaryFolder {
                _listed: Listed::new(&mut list, folder.path()),
                _lock: lock,
                folder,
            });
        }
    }
}

/// Locks a new temporary file; false if another process has removed it as abandoned in the
/// meantime.
fn lock_new(file: &File, path: &Path) -> bool {
    match file.try_lock() {
        Ok(()) => path.exists(),
        Err(TryLockError::WouldBlock) => false,
        // Some file systems have no locks; there, nothing is removed as abandoned.
        Err(TryLockError::Error(_)) => true,
    }
}

/// Removes files abandoned in `folder` by killed programs, once per process.
fn remove_abandoned(folder: &Path) {
    let mut tidied = CLEANED_FOLDERS
        .lock()
        .unwrap_or_else(PoisonError::into_inner);
    if !tidied.insert(folder.to_owned()) {
        return;
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_ours = |name: &std::ffi::OsStr| name.as_encoded_bytes().starts_with(PREFIX.as_bytes());
    for entry in entries.filter(|entry| is_ours(&entry.file_name())) {
        let path = entry.path();
        if let Some(_locked) = lock_if_abandoned(&path) {
            // A failure is harmless.
            let _ = remove(&path);
        }
    }
}

/// Locks a temporary file or folder if it is abandoned.
fn lock_if_abandoned(path: &Path) -> Option<File> {
    let kind = path.symlink_metadata().ok()?.file_type();
    if !(kind.is_file() || kind.is_dir()) || holds_replaced(path) {
        return None;
    }
    let file = File::open(path).ok()?;
    file.try_lock().is_ok().then_some(file)
}

/// True if `path` is a result that is being replaced, or a folder with one.
fn holds_replaced(path: &Path) -> bool {
    let is_replaced = |path: &Path| {
        let name = path.as_os_str().as_encoded_bytes();
        name.ends_with(REPLACED_SUFFIX.as_bytes())
    };
    let mut within = std::fs::read_dir(path).into_iter().flatten().flatten();
    is_replaced(path) || within.any(|entry| is_replaced(&entry.path()))
}

fn remove(path: &Path) -> io::Result<()> {
    std::fs::remove_file(path).or_else(|_| std::fs::remove_dir_all(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_works_on_is_tidied_away_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let folder = |name: &str, inside: &str| {
            std::fs::create_dir(path(name)).unwrap();
            std::fs::write(path(name).join(inside), "half").unwrap();
        };
        std::fs::write(path(".tunnelstitch-dead.part"), "half").unwrap();
        folder(".tunnelstitch-dead", "half.png");
        std::fs::write(path(".tunnelstitch-alive.part"), "half").unwrap();
        folder(".tunnelstitch-alive", "half.png");
        folder(".tunnelstitch-aside", "content.replaced");
        std::fs::write(path(".tunnelstitch-aside.part.replaced"), "old").unwrap();
        std::fs::write(path("result.tif"), "whole").unwrap();
        // Locked like by another process.
        let names = [".tunnelstitch-alive.part", ".tunnelstitch-alive"];
        let locks = names.map(|name| File::open(path(name)).unwrap());
        locks.iter().for_each(|lock| lock.lock().unwrap());

        let made = file_in(dir.path()).unwrap();
        assert!(is_unfinished(&made.path) && !is_unfinished(&path("result.tif")));
        drop(made);
        let entries = std::fs::read_dir(dir.path()).unwrap();
        let mut left: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        let aside = [".tunnelstitch-aside", ".tunnelstitch-aside.part.replaced"];
        let expected = [names[1], names[0], aside[0], aside[1], "result.tif"];
        assert_eq!(left, expected);
    }

    #[test]
    fn what_is_being_written_is_nobody_elses() {
        let dir = tempfile::tempdir().unwrap();
        let (file, folder) = (file_in(dir.path()).unwrap(), folder_in(dir.path()).unwrap());
        assert!(lock_if_abandoned(&file.path).is_none());
        assert!(lock_if_abandoned(folder.folder.path()).is_none());
        assert!(is_unfinished(&folder.folder.path().join("a/b.png")));
    }
}
