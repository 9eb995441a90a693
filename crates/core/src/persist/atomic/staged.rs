//! Staged folders, which appear as a whole, and scratch folders.

use super::durable;
use super::error::WriteError;
use super::file::create_folder;
use super::parent::parent_folder;
use super::temporary::{self, TemporaryFolder};
use std::path::{Path, PathBuf};

/// A folder that is filled under a temporary name beside its final one.
pub struct StagedFolder {
    target: PathBuf,
    folder: PathBuf,
    /// The temporary folder that holds it; None if it is kept in any case.
    temporary: Option<TemporaryFolder>,
}

impl StagedFolder {
    /// Begins the folder `target`; missing parent folders are created.
    ///
    /// # Errors
    /// An error of the operating system; a target without a name of its own (`.`, `..`, `/`), or
    /// one that contains the working directory.
    pub fn begin(target: &Path) -> Result<Self, WriteError> {
        check_replaceable(target)?;
        create_folder(parent_folder(target))?;
        let temporary = temporary_beside(target)?;
        let folder = temporary.content();
        create_folder(&folder)?;
        Ok(Self {
            target: target.to_owned(),
            folder,
            temporary: Some(temporary),
        })
    }

    /// Continues the folder `target` from the existing `folder` on the same disk, which is kept
    /// until it is complete.
    ///
    /// # Errors
    /// The errors of [`StagedFolder::begin`].
    pub fn adopt(target: &Path, folder: &Path) -> Result<Self, WriteError> {
        check_replaceable(target)?;
        Ok(Self {
            target: target.to_owned(),
            folder: folder.to_owned(),
            temporary: None,
        })
    }

    /// The folder to write to.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// The target and its content, synchronised to disk, in a temporary folder.
    pub(super) fn into_complete(self) -> Result<(PathBuf, TemporaryFolder), WriteError> {
        let fail = |source| WriteError::new(&self.target, source);
        durable::sync_tree(&self.folder).map_err(fail)?;
        let temporary = match self.temporary {
            Some(temporary) => temporary,
            // Under its own name, the old content would be taken for the new after the exchange.
            None => {
                let temporary = temporary_beside(&self.target)?;
                std::fs::rename(&self.folder, temporary.content()).map_err(fail)?;
                temporary
            }
        };
        Ok((self.target, temporary))
    }
}

/// A temporary folder beside `target`.
fn temporary_beside(target: &Path) -> Result<TemporaryFolder, WriteError> {
    let folder = temporary::folder_in(parent_folder(target));
    folder.map_err(|source| WriteError::new(target, source))
}

/// Rejects a folder that cannot be replaced as a whole.
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

/// A scratch folder, removed with its content when dropped or when the program is interrupted.
pub struct ScratchFolder(TemporaryFolder);

impl ScratchFolder {
    /// Creates a scratch folder inside `parent`.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn inside(parent: &Path) -> Result<Self, WriteError> {
        let folder = temporary::folder_in(parent);
        folder
            .map(Self)
            .map_err(|source| WriteError::new(parent, source))
    }

    /// The path of the folder.
    pub fn path(&self) -> &Path {
        self.0.folder.path()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::persist::atomic::write::write_text;

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
