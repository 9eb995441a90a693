//! Staged folders, which appear as a whole, and scratch folders.

use super::durable;
use super::error::WriteError;
use super::file::create_folder;
use super::parent::parent_folder;
use super::temporary::{self, REPLACED_NAME, TemporaryFolder};
use std::path::{Path, PathBuf};

/// A folder that is filled under a temporary name beside its final one.
pub struct StagedFolder {
    folder: PathBuf,
    /// The temporary folder; None if the folder is kept in any case.
    temporary: Option<TemporaryFolder>,
    target: PathBuf,
}

impl StagedFolder {
    /// Begins the folder `target`; missing parent folders are created.
    ///
    /// # Errors
    /// An error of the operating system; a target without a name of its own (`.`, `..`, `/`), or
    /// one that contains the working directory.
    pub fn begin(target: &Path) -> Result<Self, WriteError> {
        check_replaceable(target)?;
        let parent = parent_folder(target);
        create_folder(parent)?;
        let temporary =
            temporary::folder_in(parent).map_err(|source| WriteError::new(target, source))?;
        Ok(Self {
            folder: temporary.folder.path().to_owned(),
            temporary: Some(temporary),
            target: target.to_owned(),
        })
    }

    /// Continues the folder `target` from the existing `folder` on the same disk, which is kept in
    /// any case.
    ///
    /// # Errors
    /// The errors of [`StagedFolder::begin`].
    pub fn adopt(target: &Path, folder: &Path) -> Result<Self, WriteError> {
        check_replaceable(target)?;
        Ok(Self {
            folder: folder.to_owned(),
            temporary: None,
            target: target.to_owned(),
        })
    }

    /// The folder to write to.
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Renames the folder to its final name; a folder of that name is replaced.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn finish(self) -> Result<(), WriteError> {
        let fail = |source| WriteError::new(&self.target, source);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // A temporary folder is private; the finished one gets the permissions of its parent.
            let mode = std::fs::metadata(parent_folder(&self.target))
                .map_err(fail)?
                .permissions()
                .mode();
            let mode = std::fs::Permissions::from_mode(mode & 0o777);
            std::fs::set_permissions(&self.folder, mode).map_err(fail)?;
        }
        durable::sync_tree(&self.folder).map_err(fail)?;
        // The old folder is renamed first and removed only when the new one is in place.
        let mut old = None;
        if self.target.exists() {
            let aside = temporary::folder_in(parent_folder(&self.target)).map_err(fail)?;
            std::fs::rename(&self.target, aside.folder.path().join(REPLACED_NAME)).map_err(fail)?;
            old = Some(aside);
        }
        if let Err(error) = std::fs::rename(&self.folder, &self.target) {
            if let Some(aside) = &old {
                std::fs::rename(aside.folder.path().join(REPLACED_NAME), &self.target)
                    .map_err(fail)?;
            }
            return Err(fail(error));
        }
        if let Some(TemporaryFolder { folder, .. }) = self.temporary {
            // The folder is no longer temporary.
            let _ = folder.keep();
        }
        durable::sync_folder(parent_folder(&self.target));
        if let Some(aside) = old {
            let aside = aside.folder.path();
            // From now on it may be removed as abandoned.
            std::fs::rename(aside.join(REPLACED_NAME), aside.join("replaced")).map_err(fail)?;
        }
        Ok(())
    }
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
    use crate::persist::atomic::file::write_text;

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
