//! Checkpoints of long runs, to resume them after an interruption, a crash or a full disk.
//!
//! A checkpoint is a folder `NAME.unfinished` beside the result, or in it, with atomically replaced
//! files: `origin`, which identifies the run, and states. It may also hold files to which the run
//! appends; a state records their valid length. A checkpoint belongs to one run: the same version
//! of the program with the same options and inputs ([`Origin`]); any other run is refused. It is
//! removed when the run ends.
//!
//! A state is stored in the format of `postcard`, which restores every number bit for bit, followed
//! by its BLAKE3 hash. The format names neither fields nor types: only the version of the program
//! that wrote a state reads it.
//!
//! # Example
//!
//! ```
//! use tunnelstitch_core::persist::checkpoint::{Checkpoint, Origin, folder_of};
//!
//! # let folder = tempfile::tempdir()?;
//! # let result = folder.path().join("poses.tum");
//! let origin = Origin {
//!     program: "my program 1.0".to_owned(),
//!     options: String::new(),
//!     survey: String::new(),
//!     inputs: Vec::new(),
//! };
//! let mut checkpoint = Checkpoint::open(&folder_of(&result), &origin, false)?;
//! checkpoint.keep("step", &vec![1.5, 0.25])?;
//! drop(checkpoint);
//!
//! // The run is interrupted here, and goes on where it was.
//! let checkpoint = Checkpoint::open(&folder_of(&result), &origin, false)?;
//! assert_eq!(checkpoint.state::<Vec<f64>>("step")?, Some(vec![1.5, 0.25]));
//! checkpoint.finish()?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use super::atomic::{self, WriteError};
use super::file_lock::FileLock;
use super::hashed_file;
use super::provenance::Input;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use std::fs::TryLockError;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tunnelstitch_geometry::files::open_without_links;
use tunnelstitch_geometry::files::printed;

/// Name of the file that identifies the run.
const ORIGIN_FILE: &str = "origin";
/// Extension of state files.
const STATE_EXTENSION: &str = "state";
/// Name of the lock file.
const LOCK_FILE: &str = "lock";
/// Shortest time between two states.
const MIN_SAVE_INTERVAL: Duration = Duration::from_millis(250);
/// Shortest time between two states, as a multiple of the duration of the last save.
const MIN_SAVE_INTERVAL_RATIO: u32 = 50;

/// An error of resuming or saving a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The checkpoint belongs to another run.
    #[error(
        "{}: it holds an interrupted run that cannot be resumed: {what}; give --fresh to restart, \
         or another --out",
        printed(folder)
    )]
    Other {
        /// The folder.
        folder: PathBuf,
        /// The difference.
        what: String,
    },
    /// The checkpoint is corrupt.
    #[error(
        "{}: the interrupted run in it is corrupt ({what}); give --fresh to restart",
        printed(folder)
    )]
    Damaged {
        /// The folder.
        folder: PathBuf,
        /// The problem.
        what: String,
    },
    /// Another process uses the checkpoint.
    #[error(
        "{}: another run is writing the same result; wait for it, or give another --out",
        printed(folder)
    )]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// An error of the operating system.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// The identity of a run: everything that its result depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// Name and version of the program.
    pub program: String,
    /// The effective options.
    pub options: String,
    /// `survey.toml` with the changes by flags.
    pub survey: String,
    /// Hashes of the inputs.
    pub inputs: Vec<Input>,
}

impl Origin {
    /// Describes the difference to another run.
    pub(super) fn difference(&self, other: &Self) -> Option<String> {
        if self.program != other.program {
            return Some(format!(
                "it is of {}, and this is {}",
                self.program, other.program
            ));
        }
        if self.options != other.options {
            return Some("its options differ".to_owned());
        }
        if self.survey != other.survey {
            return Some("its survey.toml, or a flag that overrides it, differs".to_owned());
        }
        if self.inputs.len() != other.inputs.len() {
            return Some("its inputs differ".to_owned());
        }
        // The files may be named relative to another folder.
        let mut pairs = self.inputs.iter().zip(&other.inputs);
        let pair = pairs.find(|(own, other)| own.blake3 != other.blake3);
        pair.map(|(own, _)| format!("{} has changed since", printed(&own.path)))
    }
}

/// The checkpoint of one run, locked during its lifetime.
#[derive(Debug)]
pub struct Checkpoint {
    folder: PathBuf,
    /// Folders outside that belong to the checkpoint.
    others: Vec<PathBuf>,
    begun: bool,
    /// Time of the last save.
    kept: Instant,
    /// Duration until the next save is due.
    wait: Duration,
    /// Time at which the current save became due.
    due: Option<Instant>,
    _lock: Option<FileLock>,
    /// Folders and locks of other outputs.
    locks: Vec<(PathBuf, Option<FileLock>)>,
}

impl Checkpoint {
    /// Opens or creates the checkpoint in `folder`; `fresh` discards its content to restart the
    /// run.
    ///
    /// # Errors
    /// A checkpoint of another run, a corrupt one, or one in use; an error of the operating system.
    pub fn open(folder: &Path, origin: &Origin, fresh: bool) -> Result<Self, CheckpointError> {
        atomic::create_folder(folder)?;
        let mut checkpoint = Self {
            folder: folder.to_owned(),
            others: Vec::new(),
            begun: false,
            kept: Instant::now(),
            wait: MIN_SAVE_INTERVAL,
            due: None,
            _lock: lock(folder)?,
            locks: Vec::new(),
        };
        checkpoint.begun = !fresh && checkpoint.kept_files()?.iter().any(|path| is_state(path));
        if checkpoint.begun {
            let what = match checkpoint.read_origin()? {
                Some(kept) => kept.difference(origin),
                None => Some("its origin is missing".to_owned()),
            };
            if let Some(what) = what {
                let folder = checkpoint.folder;
                return Err(CheckpointError::Other { folder, what });
            }
        } else {
            checkpoint.clear()?;
            checkpoint.write_origin(origin)?;
        }
        Ok(checkpoint)
    }

    /// The files of the checkpoint except the lock, states first.
    fn kept_files(&self) -> Result<Vec<PathBuf>, WriteError> {
        let entries = std::fs::read_dir(&self.folder)
            .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
        let mut paths: Vec<PathBuf> =
            entries.map_err(|source| WriteError::new(&self.folder, source))?;
        paths.retain(|path| path.file_name() != Some(LOCK_FILE.as_ref()));
        paths.sort_by_key(|path| !is_state(path));
        Ok(paths)
    }

    /// Removes the content, states first, so that a run killed meanwhile leaves no state without
    /// its origin.
    fn clear(&self) -> Result<(), WriteError> {
        let kept = self.kept_files()?;
        kept.iter().try_for_each(|path| atomic::remove_file(path))
    }

    /// The path of the file `name` of the checkpoint, to which the run appends.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// A folder beside `target`, for data on the same disk. It is removed with the checkpoint; if
    /// it is missing, the run restarts. Must be called before any state is read.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn folder_beside(&mut self, target: &Path) -> Result<PathBuf, WriteError> {
        let folder = folder_of(target);
        if self.begun && !folder.is_dir() {
            let kept = self.kept_files()?;
            let mut states = kept.iter().filter(|path| is_state(path));
            states.try_for_each(|path| atomic::remove_file(path))?;
            self.begun = false;
        }
        if !self.begun && folder.is_dir() {
            std::fs::remove_dir_all(&folder).map_err(|source| WriteError::new(&folder, source))?;
        }
        atomic::create_folder(&folder)?;
        self.others.push(folder.clone());
        Ok(folder)
    }

    /// Locks another output of the run, so that no run with another result writes it meanwhile: by
    /// the lock of [`folder_of`] it, which is removed with the checkpoint.
    ///
    /// # Errors
    /// [`CheckpointError::Busy`] while another run has it; an error of the operating system.
    pub fn lock_also(&mut self, output: &Path) -> Result<(), CheckpointError> {
        let folder = folder_of(output);
        atomic::create_folder(&folder)?;
        let locked = lock(&folder)?;
        self.locks.push((folder, locked));
        Ok(())
    }

    /// True if the run resumes from saved states.
    pub fn is_begun(&self) -> bool {
        self.begun
    }

    /// Loads the state `name`, if it was saved.
    ///
    /// # Errors
    /// [`CheckpointError::Damaged`] if it is corrupt or not an `S`.
    pub fn state<S: DeserializeOwned>(&self, name: &str) -> Result<Option<S>, CheckpointError> {
        let file = state_file(name);
        let Some(content) = self.read(&file)? else {
            return Ok(None);
        };
        match postcard::take_from_bytes(&content) {
            Ok((state, [])) => Ok(Some(state)),
            Ok(_) => Err(self.damaged(&file, "it is too long")),
            Err(error) => Err(self.damaged(&file, error)),
        }
    }

    /// Saves the state `name`, replacing the previous one. The duration, from when it became due,
    /// determines when the next is due.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn keep<S: Serialize>(&mut self, name: &str, state: &S) -> Result<(), WriteError> {
        let since = self.due.take().unwrap_or_else(Instant::now);
        self.write(&state_file(name), |writer| {
            postcard::to_io(state, writer).map_err(io::Error::other)?;
            Ok(())
        })?;
        self.kept = Instant::now();
        self.wait = MIN_SAVE_INTERVAL.max(MIN_SAVE_INTERVAL_RATIO * since.elapsed());
        Ok(())
    }

    /// True if the next state is due.
    pub fn is_due(&mut self) -> bool {
        let due = self.kept.elapsed() >= self.wait;
        self.due = due.then(Instant::now);
        due
    }

    fn read_origin(&self) -> Result<Option<Origin>, CheckpointError> {
        let Some(content) = self.read(ORIGIN_FILE)? else {
            return Ok(None);
        };
        let origin = serde_json::from_slice(&content);
        origin.map_err(|error| self.damaged(ORIGIN_FILE, error))
    }

    fn write_origin(&self, origin: &Origin) -> Result<(), WriteError> {
        self.write(ORIGIN_FILE, |writer| {
            serde_json::to_writer(writer, origin).map_err(io::Error::from)
        })
    }

    fn damaged(&self, file: &str, what: impl Display) -> CheckpointError {
        CheckpointError::Damaged {
            folder: self.folder.clone(),
            what: format!("{file}: {what}"),
        }
    }

    /// The content of a file, if it is there, without the hash that ends it.
    fn read(&self, file: &str) -> Result<Option<Vec<u8>>, CheckpointError> {
        let path = self.folder.join(file);
        match hashed_file::read(&path) {
            Err(error) if error.kind() == ErrorKind::InvalidData => Err(self.damaged(file, error)),
            Err(error) => Err(WriteError::new(&path, error).into()),
            Ok(content) => Ok(content),
        }
    }

    /// Writes a file, ended by the hash of its content.
    fn write(
        &self,
        file: &str,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), WriteError> {
        hashed_file::write(&self.folder.join(file), content)
    }

    /// Removes the checkpoint at the end of the run.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn finish(self) -> Result<(), WriteError> {
        self.clear()?;
        let locked = self.locks.iter().map(|(folder, _)| folder);
        let folders = self.others.iter().chain(locked).chain([&self.folder]);
        for folder in folders.filter(|folder| folder.is_dir()) {
            std::fs::remove_dir_all(folder).map_err(|source| WriteError::new(folder, source))?;
        }
        Ok(())
    }
}

fn state_file(name: &str) -> String {
    format!("{name}.{STATE_EXTENSION}")
}

fn is_state(path: &Path) -> bool {
    path.extension() == Some(STATE_EXTENSION.as_ref())
}

/// The checkpoint folder of the run that produces `result`: its name with `.unfinished` appended.
pub fn folder_of(result: &Path) -> PathBuf {
    let mut name = result.as_os_str().to_owned();
    name.push(".unfinished");
    name.into()
}

/// Locks the folder; None where the file system has no locks: the run goes on without.
fn lock(folder: &Path) -> Result<Option<FileLock>, CheckpointError> {
    // Its files are removed, so it must not lead elsewhere.
    if folder.is_symlink() {
        let what = io::Error::other("it is a symbolic link, which is not followed; remove it");
        return Err(WriteError::new(folder, what).into());
    }
    let path = folder.join(LOCK_FILE);
    let fail = |source| WriteError::new(&path, source);
    let file = open_without_links(&path).map_err(fail)?;
    match FileLock::take(file) {
        Ok(lock) => Ok(Some(lock)),
        Err(TryLockError::WouldBlock) => Err(CheckpointError::Busy {
            folder: folder.to_owned(),
        }),
        Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => Ok(None),
        Err(TryLockError::Error(error)) => Err(fail(error).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin() -> Origin {
        let input = |path: &str| Input {
            path: path.into(),
            files: None,
            blake3: "0".to_owned(),
        };
        Origin {
            program: "tunnelstitch 1".to_owned(),
            options: "fast".to_owned(),
            survey: "radius_m = 3".to_owned(),
            inputs: vec![input("a"), input("b")],
        }
    }

    #[test]
    fn a_state_comes_back_with_all_its_bits() {
        let dir = tempfile::tempdir().unwrap();
        let folder = folder_of(&dir.path().join("wall.tif"));
        let numbers = vec![0.1f64, f64::NAN, f64::NEG_INFINITY, 5e-324, -0.0];
        let state = (numbers, Some(0.3f32), "text".to_owned());
        let mut checkpoint = Checkpoint::open(&folder, &origin(), false).unwrap();
        assert!(!checkpoint.is_begun());
        checkpoint.keep("a", &"an earlier one").unwrap();
        checkpoint.keep("a", &state).unwrap();
        checkpoint.keep("b", &1u8).unwrap();
        assert!(!checkpoint.is_due());
        drop(checkpoint);
        let mut checkpoint = Checkpoint::open(&folder, &origin(), false).unwrap();
        assert!(checkpoint.is_begun());
        let back: (Vec<f64>, Option<f32>, String) = checkpoint.state("a").unwrap().unwrap();
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
        assert_eq!(bits(&back.0), bits(&state.0));
        assert_eq!((back.1, back.2), (state.1, state.2));
        assert_eq!(checkpoint.state::<u8>("b").unwrap(), Some(1));
        assert_eq!(checkpoint.state::<u8>("c").unwrap(), None);
        let beside = checkpoint.folder_beside(&dir.path().join("tiles")).unwrap();
        assert!(beside.is_dir());
        checkpoint.finish().unwrap();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_run_killed_while_it_clears_up_can_be_restarted() {
        let dir = tempfile::tempdir().unwrap();
        let mut checkpoint = Checkpoint::open(dir.path(), &origin(), false).unwrap();
        for state in ["a", "b", "z"] {
            checkpoint.keep(state, &1).unwrap();
        }
        std::fs::write(checkpoint.file("log"), "").unwrap();
        let files = checkpoint.kept_files().unwrap();
        drop(checkpoint);
        let left = files.iter().position(|path| {
            std::fs::remove_file(path).unwrap();
            let again = Checkpoint::open(dir.path(), &origin(), false).unwrap();
            !again.is_begun()
        });
        assert_eq!(left, Some(2));
    }

    #[test]
    fn another_run_is_refused_with_what_is_different() {
        let dir = tempfile::tempdir().unwrap();
        let mut checkpoint = Checkpoint::open(dir.path(), &origin(), false).unwrap();
        checkpoint.keep("a", &1).unwrap();
        drop(checkpoint);
        let refused = |change: fn(&mut Origin), what: &str| {
            let mut other = origin();
            change(&mut other);
            let error = Checkpoint::open(dir.path(), &other, false).unwrap_err();
            let error = error.to_string();
            assert!(error.contains(what) && error.contains("--fresh"), "{error}");
        };
        refused(
            |o| o.program = "tunnelstitch 2".to_owned(),
            "of tunnelstitch 1",
        );
        refused(|o| o.options.push('!'), "options");
        refused(|o| o.survey.push('!'), "survey.toml");
        refused(|o| o.inputs[1].blake3.push('1'), "b has changed");
        refused(|o| o.inputs.truncate(1), "inputs differ");
        let other = Origin {
            options: String::new(),
            ..origin()
        };
        let fresh = Checkpoint::open(dir.path(), &other, true).unwrap();
        assert!(!fresh.is_begun());
        assert_eq!(fresh.state::<u8>("a").unwrap(), None);
    }

    #[test]
    fn a_damaged_state_and_one_in_use_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let mut checkpoint = Checkpoint::open(dir.path(), &origin(), false).unwrap();
        checkpoint.keep("a", &vec![1, 2, 3]).unwrap();
        let busy = Checkpoint::open(dir.path(), &origin(), false);
        assert!(matches!(busy, Err(CheckpointError::Busy { .. })));
        let path = checkpoint.file("a.state");
        let sound = std::fs::read(&path).unwrap();
        let damaged = |state: Result<Option<Vec<u8>>, CheckpointError>| {
            matches!(state, Err(CheckpointError::Damaged { .. }))
        };
        for length in 0..sound.len() {
            std::fs::write(&path, &sound[..length]).unwrap();
            assert!(damaged(checkpoint.state("a")), "{length}");
        }
        std::fs::write(&path, &sound).unwrap();
        assert_eq!(checkpoint.state("a").unwrap(), Some(vec![1, 2, 3]));
        // An intact state may still be of another type.
        checkpoint.keep("a", &("text", 1)).unwrap();
        assert!(damaged(checkpoint.state("a")));
    }
}
