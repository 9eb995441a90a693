//! Outputs that appear together or not at all.

use super::error::WriteError;
use super::error_keeper::ErrorKeeper;
use super::exchange::exchange;
use super::parent::parent_folder;
use super::staged::StagedFolder;
use super::temporary::{self, TemporaryFile, TemporaryFolder};
use super::{durable, file};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::check_replaceable_file;

/// The files and folders of one result, each complete under a temporary name beside its own until
/// [`OutputSet::commit`] gives all of them their names. An error before or during that leaves
/// everything as it was. The old result is removed last.
#[derive(Default)]
pub struct OutputSet {
    replacements: Vec<Replacement>,
}

/// The new content of a file or a folder.
struct Replacement {
    target: PathBuf,
    new: New,
}

/// A new content.
enum New {
    File(TemporaryFile),
    Folder(TemporaryFolder),
    /// None; the old one goes into the folder.
    Nothing(TemporaryFolder),
}

impl OutputSet {
    /// Adds the file `path`, which may lie in a folder of the set; `fill` writes its content.
    ///
    /// # Errors
    /// An error of the operating system about the folder or writing.
    pub fn write(
        &mut self,
        path: &Path,
        fill: impl FnOnce(&mut BufWriter<ErrorKeeper<File>>) -> io::Result<()>,
    ) -> Result<(), WriteError> {
        if let Some(place) = self.place_in_folder(path) {
            let fail = |source| WriteError::new(path, source);
            let new = file::fill_temporary(&place, fill).map_err(|error| fail(error.source))?;
            std::fs::rename(&*new.path, &place).map_err(fail)?;
            durable::sync_folder(parent_folder(&place));
            return Ok(());
        }
        let new = New::File(file::fill_temporary(path, fill)?);
        self.add(path, new);
        Ok(())
    }

    /// The place of a file in a new folder of the set; None if it lies in none.
    fn place_in_folder(&self, path: &Path) -> Option<PathBuf> {
        let folders = self.replacements.iter();
        folders
            .filter(|replacement| matches!(replacement.new, New::Folder(_)))
            .find_map(|folder| {
                let within = path.strip_prefix(&folder.target).ok()?;
                Some(folder.place().join(within))
            })
    }

    /// Adds a text file; see [`OutputSet::write`].
    ///
    /// # Errors
    /// The errors of [`OutputSet::write`].
    pub fn write_text(&mut self, path: &Path, text: &str) -> Result<(), WriteError> {
        self.write(path, |writer| writer.write_all(text.as_bytes()))
    }

    /// Adds the absence of a file: one of an earlier result is removed.
    ///
    /// # Errors
    /// An error of the operating system about the folder; a target that is no file.
    pub fn remove(&mut self, path: &Path) -> Result<(), WriteError> {
        let fail = |source| WriteError::new(path, source);
        if path.symlink_metadata().is_ok() {
            check_replaceable_file(path).map_err(fail)?;
            let folder = temporary::folder_in(parent_folder(path)).map_err(fail)?;
            self.add(path, New::Nothing(folder));
        }
        Ok(())
    }

    /// Adds a folder, which replaces one of the same name as a whole.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn folder(&mut self, staged: StagedFolder) -> Result<(), WriteError> {
        let (target, folder) = staged.into_complete()?;
        self.add(&target, New::Folder(folder));
        Ok(())
    }

    /// Names of the files and folders that are written, in the order in which they were added,
    /// without their paths.
    pub fn file_names(&self) -> Vec<String> {
        let written = self.replacements.iter();
        written
            .filter(|replacement| !matches!(replacement.new, New::Nothing(_)))
            .filter_map(|replacement| replacement.target.file_name())
            .map(|name| name.to_string_lossy().into_owned())
            .collect()
    }

    fn add(&mut self, target: &Path, new: New) {
        let target = target.to_owned();
        self.replacements.push(Replacement { target, new });
    }

    /// Gives everything its name, in the order in which it was added.
    ///
    /// All data are on disk before, so only names change here, and [`temporary::remove_unfinished`]
    /// waits for it. A program that is killed meanwhile leaves some of the new names, and the old
    /// content under temporary ones; where it is run again, it completes them.
    ///
    /// # Errors
    /// An error of the operating system, after all names were given back.
    pub fn commit(self) -> Result<(), WriteError> {
        let exchanged = {
            let _uninterrupted = temporary::hold_list();
            self.exchange_all()
        };
        let folders: BTreeSet<&Path> = (self.replacements.iter())
            .map(|replacement| parent_folder(&replacement.target))
            .filter(|folder| !temporary::is_unfinished(folder))
            .collect();
        folders.into_iter().for_each(durable::sync_folder);
        exchanged
    }

    fn exchange_all(&self) -> Result<(), WriteError> {
        for (done, replacement) in self.replacements.iter().enumerate() {
            // Nothing can fail after the last, so it needs no way back.
            let is_last = done + 1 == self.replacements.len();
            if let Err(source) = replacement.take_place(is_last) {
                for earlier in self.replacements[..done].iter().rev() {
                    // The first error is the one to report.
                    let _ = exchange(&earlier.place(), &earlier.target);
                }
                return Err(WriteError::new(&replacement.target, source));
            }
        }
        Ok(())
    }
}

impl StagedFolder {
    /// Renames the folder to its final name; a folder of that name is replaced.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn finish(self) -> Result<(), WriteError> {
        let mut set = OutputSet::default();
        set.folder(self)?;
        set.commit()
    }
}

impl Replacement {
    /// Place of the new content, and of the old one after the exchange.
    fn place(&self) -> PathBuf {
        match &self.new {
            New::File(file) => file.path.to_path_buf(),
            New::Folder(folder) | New::Nothing(folder) => folder.content(),
        }
    }

    /// Exchanges the new content and the old one; `for_good` forgets an old file.
    fn take_place(&self, for_good: bool) -> io::Result<()> {
        let place = self.place();
        match &self.new {
            New::File(_) if for_good => std::fs::rename(&place, &self.target),
            // An exchange with a missing one would remove the old content.
            New::File(_) | New::Folder(_) => {
                place.symlink_metadata()?;
                exchange(&place, &self.target)
            }
            New::Nothing(_) => exchange(&place, &self.target),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    /// A set with a file, a folder and a removal, and at last a file in `last`.
    fn set(dir: &Path, text: &str, last: &Path) -> OutputSet {
        let mut set = OutputSet::default();
        set.write_text(&dir.join("a.txt"), text).unwrap();
        let folder = StagedFolder::begin(&dir.join("tiles")).unwrap();
        std::fs::write(folder.path().join(text), "").unwrap();
        set.folder(folder).unwrap();
        set.remove(&dir.join("map")).unwrap();
        set.write_text(&last.join("z.txt"), text).unwrap();
        set
    }

    fn state(dir: &Path) -> (Vec<String>, String, Vec<String>) {
        let text = std::fs::read_to_string(dir.join("a.txt")).unwrap_or_default();
        (names(dir), text, names(&dir.join("tiles")))
    }

    #[test]
    fn a_set_appears_whole_and_replaces_an_old_one() {
        let dir = tempfile::tempdir().unwrap();
        for text in ["first", "second"] {
            std::fs::write(dir.path().join("map"), "old").unwrap();
            let set = set(dir.path(), text, dir.path());
            assert_eq!(set.file_names(), ["a.txt", "tiles", "z.txt"]);
            set.commit().unwrap();
            let (names, content, tiles) = state(dir.path());
            assert_eq!(names, ["a.txt", "tiles", "z.txt"]);
            assert_eq!((content.as_str(), tiles), (text, vec![text.to_owned()]));
        }
    }

    #[test]
    fn a_failure_at_the_last_name_leaves_the_old_set_and_no_litter() {
        let dir = tempfile::tempdir().unwrap();
        let last = dir.path().join("last");
        std::fs::create_dir(&last).unwrap();
        // A file cannot take the place of a folder.
        let fail = |set: OutputSet| {
            let _ = std::fs::remove_file(last.join("z.txt"));
            std::fs::create_dir(last.join("z.txt")).unwrap();
            assert!(set.commit().is_err());
            std::fs::remove_dir(last.join("z.txt")).unwrap();
        };
        fail(set(dir.path(), "new", &last));
        assert_eq!(names(dir.path()), ["last"]);

        set(dir.path(), "old", &last).commit().unwrap();
        std::fs::write(dir.path().join("map"), "old").unwrap();
        let before = state(dir.path());
        fail(set(dir.path(), "new", &last));
        assert_eq!(state(dir.path()), before);
    }

    #[test]
    fn a_file_in_a_folder_of_the_set_appears_with_it() {
        let dir = tempfile::tempdir().unwrap();
        let record = dir.path().join("tiles").join("run.toml");
        for commits in [false, true] {
            let mut set = set(dir.path(), "new", dir.path());
            set.write_text(&record, "how").unwrap();
            if commits {
                set.commit().unwrap();
            }
            assert_eq!(record.exists(), commits);
        }
        assert_eq!(names(record.parent().unwrap()), ["new", "run.toml"]);
        assert_eq!(std::fs::read_to_string(&record).unwrap(), "how");
    }

    #[test]
    fn an_abandoned_set_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        drop(set(dir.path(), "new", dir.path()));
        assert_eq!(names(dir.path()).len(), 0);
    }
}
