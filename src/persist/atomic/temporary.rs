//! Temporary names: listed and locked while they are in use, and tidied away when a killed program
//! has left them.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tempfile::{TempDir, TempPath};

/// Beginning of temporary names.
const PREFIX: &str = ".tunnelstitch-";

/// Name, in a temporary folder, of a result that steps aside for its successor. Such a folder is
/// never tidied away: it may hold the only copy.
pub(super) const REPLACED_NAME: &str = "old";

/// Temporary names in use.
static UNFINISHED_PATHS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Folders in which this process has tidied.
static CLEANED_FOLDERS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Times that a folder is removed before it is left to the system.
const MAX_REMOVAL_ATTEMPTS: usize = 20;

/// A temporary name on the list of unfinished ones for as long as this lives.
struct Listed(PathBuf);

impl Listed {
    fn new(path: &Path) -> Self {
        let mut list = UNFINISHED_PATHS
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        list.push(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        let mut list = UNFINISHED_PATHS
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        list.retain(|path| *path != self.0);
    }
}

/// Removes every file and folder that is being written. For a program about to be ended from
/// outside: the writers are not told and must not go on, so the list stays locked until the process
/// ends.
pub fn remove_unfinished() {
    let list = UNFINISHED_PATHS
        .lock()
        .unwrap_or_else(PoisonError::into_inner);
    for path in list.iter() {
        // A writer that was about to make a file in a folder may still do so while it is removed.
        for _ in 0..MAX_REMOVAL_ATTEMPTS {
            // Nobody is left to tell if the system refuses.
            let _ = remove(path);
            if !path.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    std::mem::forget(list);
}

/// Whether `path` is, or lies in, something unfinished of this process.
pub(super) fn is_unfinished(path: &Path) -> bool {
    let list = UNFINISHED_PATHS
        .lock()
        .unwrap_or_else(PoisonError::into_inner);
    list.iter().any(|unfinished| path.starts_with(unfinished))
}

/// A file with a temporary name, locked while it is open.
pub(super) struct TemporaryFile {
    /// The file.
    pub file: File,
    /// Its name; it goes with this, unless it is given another.
    pub path: TempPath,
    _listed: Listed,
}

/// Makes one in `folder`.
///
/// # Errors
/// Whatever the system says.
pub(super) fn file_in(folder: &Path) -> io::Result<TemporaryFile> {
    remove_abandoned(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Those of a plain new file; the system applies the process's umask.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    loop {
        let (file, path) = builder.tempfile_in(folder)?.into_parts();
        if lock_new(&file, &path) {
            let _listed = Listed::new(&path);
            return Ok(TemporaryFile {
                file,
                path,
                _listed,
            });
        }
    }
}

/// A folder with a temporary name, locked while this lives.
pub(super) struct TemporaryFolder {
    /// The folder; it goes with this, unless it is kept.
    pub folder: TempDir,
    _listed: Listed,
    _lock: Option<File>,
}

/// Makes one in `parent`.
///
/// # Errors
/// Whatever the system says.
pub(super) fn folder_in(parent: &Path) -> io::Result<TemporaryFolder> {
    remove_abandoned(parent);
    loop {
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent)?;
        // Some systems do not open folders; there, nobody takes it for left behind either.
        let lock = File::open(folder.path()).ok();
        if lock
            .as_ref()
            .is_none_or(|lock| lock_new(lock, folder.path()))
        {
            return Ok(TemporaryFolder {
                _listed: Listed::new(folder.path()),
                _lock: lock,
                folder,
            });
        }
    }
}

/// Locks a temporary name that was just made; false if somebody has taken it for left behind in the
/// meantime.
fn lock_new(file: &File, path: &Path) -> bool {
    match file.try_lock() {
        Ok(()) => path.exists(),
        Err(TryLockError::WouldBlock) => false,
        // Some file systems have no locks; there, nothing is tidied away.
        Err(TryLockError::Error(_)) => true,
    }
}

/// Removes what killed programs have left in `folder`, once in the life of this process.
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
            // It is in nobody's way if the system refuses.
            let _ = remove(&path);
        }
    }
}

/// The lock of a temporary file or folder that nobody works on.
fn lock_if_abandoned(path: &Path) -> Option<File> {
    let kind = path.symlink_metadata().ok()?.file_type();
    if !(kind.is_file() || kind.is_dir()) || path.join(REPLACED_NAME).exists() {
        return None;
    }
    let file = File::open(path).ok()?;
    file.try_lock().is_ok().then_some(file)
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
        folder(".tunnelstitch-aside", REPLACED_NAME);
        std::fs::write(path("result.tif"), "whole").unwrap();
        // As another process would hold them.
        let names = [".tunnelstitch-alive.part", ".tunnelstitch-alive"];
        let locks = names.map(|name| File::open(path(name)).unwrap());
        locks.iter().for_each(|lock| lock.lock().unwrap());

        let made = file_in(dir.path()).unwrap();
        assert!(is_unfinished(&made.path) && !is_unfinished(&path("result.tif")));
        drop(made);
        let entries = std::fs::read_dir(dir.path()).unwrap();
        let mut left: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        let expected = [names[1], names[0], ".tunnelstitch-aside", "result.tif"];
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
