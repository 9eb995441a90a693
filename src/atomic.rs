//! Files and folders that are complete or absent: written under a temporary name beside the target, then
//! renamed.
//!
//! What is unfinished is removed when writing fails, and by [`remove_unfinished`] when the program is
//! interrupted.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tempfile::{TempDir, TempPath};

/// Temporary names in use.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Times that a folder is removed before it is left to the system.
const REMOVALS: usize = 20;

/// A temporary name on the list of unfinished ones for as long as this lives.
struct Listed(PathBuf);

impl Listed {
    fn new(path: &Path) -> Self {
        let mut list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        list.push(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        let mut list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        list.retain(|path| *path != self.0);
    }
}

/// Removes every file and folder that is being written. For a program about to be ended from outside: the
/// writers are not told and must not go on, so the list stays locked until the process ends.
pub fn remove_unfinished() {
    let list = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    for path in list.iter() {
        // A writer that was about to make a file in a folder may still do so while it is removed.
        for _ in 0..REMOVALS {
            // Nobody is left to tell if the system refuses.
            let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir_all(path));
            if !path.exists() {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    std::mem::forget(list);
}

/// An output that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write: {source}", path.display())]
pub struct WriteError {
    /// The file or folder.
    pub path: PathBuf,
    /// What the system said.
    pub source: std::io::Error,
}

impl WriteError {
    /// An error about `path`.
    pub fn new(path: &Path, source: std::io::Error) -> Self {
        Self {
            path: path.to_owned(),
            source,
        }
    }
}

/// Writes `path` through `fill`; nothing appears under that name unless everything was written.
///
/// # Errors
/// Whatever the system says about the folder, the writing or the renaming.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut std::io::BufWriter<std::fs::File>) -> std::io::Result<()>,
) -> Result<(), WriteError> {
    let fail = |source| WriteError::new(path, source);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Those of a plain new file; the system applies the process's umask.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(beside(path)).map_err(fail)?;
    let (file, temporary_path): (_, TempPath) = temporary.into_parts();
    let _listed = Listed::new(&temporary_path);
    let mut writer = std::io::BufWriter::new(file);
    fill(&mut writer).map_err(fail)?;
    writer.flush().map_err(fail)?;
    drop(writer);
    temporary_path
        .persist(path)
        .map_err(|error| fail(error.error))
}

/// Writes a text file; see [`write()`].
///
/// # Errors
/// As [`write()`].
pub fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write(path, |writer| writer.write_all(text.as_bytes()))
}

/// Beginning of temporary names.
const PREFIX: &str = ".tunnelstitch-";

/// The folder that holds `path`.
pub(crate) fn beside(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// A folder that is being filled under another name beside its final one.
pub struct StagedFolder {
    folder: PathBuf,
    /// Unless it stays whatever happens.
    temporary: Option<(Listed, TempDir)>,
    target: PathBuf,
}

impl StagedFolder {
    /// Begins the folder that will be `target`; the folders above it are made if missing.
    ///
    /// # Errors
    /// Whatever the system says; a target without a name of its own (`.`, `..`, `/`), or one that holds the folder the
    /// program works in.
    pub fn begin(target: &Path) -> Result<Self, WriteError> {
        check_replaceable(target)?;
        let parent = beside(target);
        create_folder(parent)?;
        let temporary = tempfile::Builder::new()
            .prefix(PREFIX)
            .tempdir_in(parent)
            .map_err(|source| WriteError::new(target, source))?;
        let listed = Listed::new(temporary.path());
        Ok(Self {
            folder: temporary.path().to_owned(),
            temporary: Some((listed, temporary)),
            target: target.to_owned(),
        })
    }

    /// The folder that will be `target`, with what is in `folder` on the same disk already, which stays whatever happens.
    ///
    /// # Errors
    /// As [`StagedFolder::begin`].
    pub fn kept(target: &Path, folder: &Path) -> Result<Self, WriteError> {
        check_replaceable(target)?;
        Ok(Self {
            folder: folder.to_owned(),
            temporary: None,
            target: target.to_owned(),
        })
    }

    /// Where to write for now.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Gives the folder its final name; a folder of that name is replaced.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn finish(self) -> Result<(), WriteError> {
        let fail = |source| WriteError::new(&self.target, source);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // A temporary folder is private; the finished one is as its parent.
            let mode = std::fs::metadata(beside(&self.target))
                .map_err(fail)?
                .permissions()
                .mode();
            let mode = std::fs::Permissions::from_mode(mode & 0o777);
            std::fs::set_permissions(&self.folder, mode).map_err(fail)?;
        }
        // The old folder steps aside first and goes only when the new one is in place.
        let mut old = None;
        if self.target.exists() {
            let aside = tempfile::Builder::new()
                .prefix(PREFIX)
                .tempdir_in(beside(&self.target))
                .map_err(fail)?;
            std::fs::rename(&self.target, aside.path().join("old")).map_err(fail)?;
            old = Some(aside);
        }
        if let Err(error) = std::fs::rename(&self.folder, &self.target) {
            if let Some(aside) = &old {
                // If even this fails, the old folder stays where it stepped aside.
                std::fs::rename(aside.path().join("old"), &self.target).map_err(fail)?;
            }
            return Err(fail(error));
        }
        if let Some((listed, folder)) = self.temporary {
            drop(listed);
            // It is no longer temporary.
            let _ = folder.keep();
        }
        Ok(())
    }
}

/// Refuses a folder that cannot be replaced as a whole.
fn check_replaceable(target: &Path) -> Result<(), WriteError> {
    let refuse = |what: &str| Err(WriteError::new(target, std::io::Error::other(what)));
    let named = target
        .components()
        .next_back()
        .is_some_and(|last| matches!(last, std::path::Component::Normal(_)));
    if !named {
        return refuse("it has no name of its own; name a folder that may be replaced as a whole");
    }
    if target.symlink_metadata().is_ok_and(|meta| !meta.is_dir()) {
        return refuse("it exists and is no folder");
    }
    let here = std::env::current_dir().and_then(|here| here.canonicalize());
    if let (Ok(here), Ok(target)) = (here, target.canonicalize())
        && here.starts_with(target)
    {
        return refuse("the program works in it, so it cannot be replaced");
    }
    Ok(())
}

/// A folder for what is needed for a while; it goes with all that is in it when this is dropped or the program is
/// interrupted.
pub struct ScratchFolder {
    folder: TempDir,
    _listed: Listed,
}

impl ScratchFolder {
    /// Makes one inside `parent`.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn inside(parent: &Path) -> Result<Self, WriteError> {
        let folder = tempfile::Builder::new()
            .prefix(PREFIX)
            .tempdir_in(parent)
            .map_err(|source| WriteError::new(parent, source))?;
        Ok(Self {
            _listed: Listed::new(folder.path()),
            folder,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes a file, if it is there.
///
/// # Errors
/// Whatever the system says.
pub fn remove_file(path: &Path) -> Result<(), WriteError> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(WriteError::new(path, error))
        }
        _ => Ok(()),
    }
}

/// Makes a folder and those above it.
///
/// # Errors
/// Whatever the system says; a file in its place.
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

    #[test]
    fn a_staged_folder_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("deep/folder");
        let abandoned = StagedFolder::begin(&target).unwrap();
        write_text(&abandoned.path().join("a.txt"), "half").unwrap();
        drop(abandoned);
        assert!(!target.exists());
        for text in ["first", "second"] {
            let staged = StagedFolder::begin(&target).unwrap();
            write_text(&staged.path().join("a.txt"), text).unwrap();
            staged.finish().unwrap();
            assert_eq!(std::fs::read_to_string(target.join("a.txt")).unwrap(), text);
        }
        for nameless in [".", "..", "/", "deep/.."] {
            assert!(
                StagedFolder::begin(Path::new(nameless)).is_err(),
                "{nameless}"
            );
        }
        let above = std::env::current_dir().unwrap();
        assert!(StagedFolder::begin(&above).is_err());
        let litter = std::fs::read_dir(dir.path().join("deep")).unwrap().count();
        assert_eq!(litter, 1);
    }
}
