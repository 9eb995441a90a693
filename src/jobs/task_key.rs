//! The key of a task: a hash of everything that its outputs follow from.

use super::error::JobError;
use super::job::{Job, Task, TriggerRule};
use super::task_state::TaskState;
use crate::persist::provenance::{self, HashError};
use crate::storage::{Mirror, StorageUrl};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tunnelstitch_core::PROGRAM;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// The keys of a job's tasks. An input of several tasks is read once.
pub struct TaskKeys<'j> {
    folder: &'j Path,
    job: &'j Job,
    places: BTreeMap<&'j str, usize>,
    /// The keys that are known, task by task.
    keys: Vec<Option<String>>,
    /// Hashes of the inputs that have been read.
    inputs: BTreeMap<&'j Path, blake3::Hash>,
}

impl<'j> TaskKeys<'j> {
    /// No key is known yet.
    pub fn new(folder: &'j Path, job: &'j Job) -> Self {
        Self {
            folder,
            job,
            places: job.places(),
            keys: vec![None; job.tasks.len()],
            inputs: BTreeMap::new(),
        }
    }

    /// The key of a task of the job: BLAKE3 of the program's version, the command, the names and
    /// contents (on storage: sizes and ETags) of its inputs, and the keys of the tasks that it
    /// comes after (or their ends, if it runs whatever these are), hexadecimal.
    ///
    /// # Errors
    /// An input that cannot be read.
    pub fn of(&mut self, task: &'j Task) -> Result<String, JobError> {
        let place = self.places[task.id.as_str()];
        if let Some(key) = &self.keys[place] {
            return Ok(key.clone());
        }
        let mut before = Vec::new();
        for id in &task.after {
            // A job is read only if what a task comes after stands before it.
            let earlier = &self.job.tasks[self.places[id.as_str()]];
            before.push(match task.trigger_rule {
                TriggerRule::AllSuccess => self.of(earlier)?,
                TriggerRule::AllDone => end_of(&TaskState::read(self.folder, earlier)?),
            });
        }
        let mut hasher = blake3::Hasher::new();
        add(&mut hasher, PROGRAM.as_bytes());
        add_all(&mut hasher, task.command.iter().map(String::as_bytes));
        for input in &task.inputs {
            add(&mut hasher, input.as_os_str().as_encoded_bytes());
            add(&mut hasher, self.input(task, input)?.as_bytes());
        }
        add_all(&mut hasher, before.iter().map(String::as_bytes));
        let key = hasher.finalize().to_hex().to_string();
        self.keys[place] = Some(key.clone());
        Ok(key)
    }

    fn input(&mut self, task: &Task, input: &'j Path) -> Result<blake3::Hash, JobError> {
        if let Some(hash) = self.inputs.get(input) {
            return Ok(*hash);
        }
        let stored = StorageUrl::of(input)
            .and_then(|url| url.map(|url| Mirror::fingerprint(&url)).transpose());
        if let Some(hash) = stored? {
            self.inputs.insert(input, hash);
            return Ok(hash);
        }
        let path = self.folder.join(input);
        if task.trigger_rule == TriggerRule::AllDone && !path.exists() {
            return Ok(blake3::hash(b""));
        }
        let files = files_of(&path);
        let hash = files.and_then(|files| hash_of(&files));
        let hash = hash.map_err(|source| JobError::Input {
            task: task.id.clone(),
            source,
        })?;
        self.inputs.insert(input, hash);
        Ok(hash)
    }
}

/// The end of a task before one that reports on it, as far as its report depends on it.
fn end_of(state: &TaskState) -> String {
    match state {
        TaskState::Done(record) => format!("{} {}", record.exit_code, record.key),
        TaskState::Failed { reason } => format!("failed: {reason}"),
        TaskState::NotRun => "not run".to_owned(),
    }
}

/// Adds a part with its length: different lists of parts cannot be the same by concatenation.
fn add(hasher: &mut blake3::Hasher, part: &[u8]) {
    hasher.update(&(part.len() as u64).to_le_bytes());
    hasher.update(part);
}

/// Adds a list with its length.
fn add_all<'p>(hasher: &mut blake3::Hasher, parts: impl ExactSizeIterator<Item = &'p [u8]>) {
    hasher.update(&(parts.len() as u64).to_le_bytes());
    parts.for_each(|part| add(hasher, part));
}

/// The files of an input, with their names in it: the file itself, or all below a folder, by name.
fn files_of(input: &Path) -> Result<Vec<(PathBuf, PathBuf)>, HashError> {
    if !input.is_dir() {
        return Ok(vec![(PathBuf::new(), input.to_owned())]);
    }
    let mut files = Vec::new();
    let mut folders = vec![input.to_owned()];
    while let Some(folder) = folders.pop() {
        let fail = |source| HashError {
            path: folder.clone(),
            source,
        };
        for entry in std::fs::read_dir(&folder).map_err(fail)? {
            let path = entry.map_err(fail)?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.is_file() {
                let name = path.strip_prefix(input).unwrap_or(&path);
                files.push((name.to_owned(), path));
            }
        }
    }
    files.sort();
    Ok(files)
}

/// The hash of files' names and contents; they are read in parallel.
fn hash_of(files: &[(PathBuf, PathBuf)]) -> Result<blake3::Hash, HashError> {
    let contents = files.par_map(|(_, path)| provenance::input(path));
    let mut hasher = blake3::Hasher::new();
    for ((name, _), content) in files.iter().zip(contents) {
        add(&mut hasher, name.as_os_str().as_encoded_bytes());
        add(&mut hasher, content?.blake3.as_bytes());
    }
    Ok(hasher.finalize())
}

#[cfg(test)]
mod tests {
    use super::super::job::tests::task;
    use super::super::process::Usage;
    use super::super::task_record::TaskRecord;
    use super::*;

    #[test]
    fn a_key_follows_whatever_the_outputs_follow_from() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let with_input = |id: &str, after: &[&str], input: &str| {
            let mut task = task(id, after);
            task.inputs = vec![input.into()];
            task
        };
        let mut job = Job::new(vec![
            with_input("a.refine", &[], "frames"),
            with_input("a.stitch", &["a.refine"], "mask.png"),
        ]);
        let keys = |job: &Job| -> Vec<String> {
            let mut keys = TaskKeys::new(dir.path(), job);
            // From the last: what it comes after is found on the way.
            let last = keys.of(&job.tasks[1]).unwrap();
            vec![keys.of(&job.tasks[0]).unwrap(), last]
        };
        write("frames/deep/1.png", "one");
        write("frames/2.png", "two");
        write("mask.png", "");
        let mut seen = keys(&job);
        assert_eq!(keys(&job), seen);
        // A later task follows from an earlier one, but not the other way round.
        write("frames/2.png", "2");
        seen.extend(keys(&job));
        write("frames/deep/3.png", "");
        seen.extend(keys(&job));
        job.tasks[0].command.push("--quiet".to_owned());
        seen.extend(keys(&job));
        write("mask.png", "mask");
        let after_mask = keys(&job);
        assert_eq!(after_mask[0], seen[6]);
        seen.push(after_mask[1].clone());
        seen.sort();
        seen.dedup();
        assert_eq!(seen.len(), 9);
    }

    #[test]
    fn the_key_of_a_report_follows_the_ends_of_the_tasks_before() {
        let dir = tempfile::tempdir().unwrap();
        let mut job = Job::new(vec![task("a.refine", &[]), task("n.map", &["a.refine"])]);
        job.tasks[1].trigger_rule = TriggerRule::AllDone;
        job.tasks[1].inputs = vec!["marks".into()];
        let key = || TaskKeys::new(dir.path(), &job).of(&job.tasks[1]).unwrap();
        // Neither the input of the first task nor that of the second is there.
        let mut seen = vec![key()];
        let log = dir.path().join("logs/a.refine.log");
        std::fs::create_dir(dir.path().join("logs")).unwrap();
        for text in ["error: no frames\n", "error: no camera\n"] {
            std::fs::write(&log, text).unwrap();
            seen.push(key());
        }
        let mut record = TaskRecord {
            key: "k".to_owned(),
            program: String::new(),
            exit_code: 0,
            usage: Usage {
                seconds: 1.0,
                processor_seconds: None,
                peak_bytes: None,
            },
        };
        record.write(dir.path(), &job.tasks[0]).unwrap();
        seen.push(key());
        // Its time is no part of what is reported.
        record.usage.seconds = 2.0;
        record.write(dir.path(), &job.tasks[0]).unwrap();
        assert_eq!(seen.last(), Some(&key()));
        record.exit_code = 4;
        record.write(dir.path(), &job.tasks[0]).unwrap();
        seen.push(key());
        std::fs::write(dir.path().join("marks"), "one").unwrap();
        seen.push(key());
        seen.sort();
        seen.dedup();
        assert_eq!(seen.len(), 6);
    }

    #[test]
    fn a_missing_input_is_named_with_its_task() {
        let dir = tempfile::tempdir().unwrap();
        let job = Job::new(vec![task("a.refine", &[])]);
        let error = TaskKeys::new(dir.path(), &job).of(&job.tasks[0]);
        let message = error.unwrap_err().to_string();
        assert!(
            message.contains("a.refine") && message.contains("in.txt"),
            "{message}"
        );
    }
}
