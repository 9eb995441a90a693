//! The folder of a job, on this machine or on storage.

use super::error::JobError;
use super::job::{JOB_FILE, Job, Task, TriggerRule};
use super::task_record::{log_path, record_path};
use crate::storage::{Mirror, StorageUrl};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The folder of a job: one of this machine, or a mirror of one on storage, whose tasks are done in
/// the mirror. Surveys are in the same bucket, so that paths from the job hold there, too.
#[derive(Clone, Debug)]
pub struct JobFolder {
    /// The path or address that was given.
    given: PathBuf,
    /// The folder on this machine.
    path: PathBuf,
    /// Its mirror and its address on storage.
    stored: Option<(Mirror, StorageUrl)>,
}

impl JobFolder {
    /// The folder of a path or an address.
    ///
    /// # Errors
    /// A malformed address.
    pub fn new(given: &Path) -> Result<Self, JobError> {
        let stored = StorageUrl::of(given)?.map(|url| (Mirror::of_user(), url));
        let mirrored = stored.as_ref().map(|(mirror, url)| mirror.path(url));
        Ok(Self {
            given: given.to_owned(),
            path: mirrored.unwrap_or_else(|| given.to_owned()),
            stored,
        })
    }

    /// The path or address that was given.
    pub fn given(&self) -> &Path {
        &self.given
    }

    /// The folder on this machine.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the job.
    ///
    /// # Errors
    /// The errors of [`Job::read`]; storage that refuses or fails.
    pub fn read_job(&self) -> Result<Job, JobError> {
        self.fetch(Path::new(JOB_FILE))?;
        Job::read(&self.path)
    }

    /// Writes the job.
    ///
    /// # Errors
    /// A file that cannot be written; storage that refuses or fails.
    pub fn write_job(&self, job: &Job) -> Result<(), JobError> {
        job.write(&self.path)?;
        self.put(Path::new(JOB_FILE))
    }

    /// Fetches all that a task needs, and its results if it is done: its inputs and those of all
    /// tasks that it follows from, their records, and the outputs of those that it comes after.
    ///
    /// # Errors
    /// Storage that refuses or fails; inputs that are not in the bucket of the job.
    pub fn fetch_for(&self, job: &Job, task: &Task) -> Result<(), JobError> {
        if self.stored.is_none() {
            return Ok(());
        }
        let mut needed: BTreeSet<PathBuf> = BTreeSet::new();
        let places = job.places();
        let of_id = |id: &String| &job.tasks[places[id.as_str()]];
        let mut rest = vec![task];
        let mut seen = BTreeSet::new();
        while let Some(earlier) = rest.pop() {
            if !seen.insert(earlier.id.as_str()) {
                continue;
            }
            needed.extend(earlier.inputs.iter().cloned());
            needed.insert(record_path(Path::new(""), earlier));
            // A report reads the ends of the tasks before it, not what these follow from.
            match earlier.trigger_rule {
                TriggerRule::AllSuccess => rest.extend(earlier.after.iter().map(of_id)),
                TriggerRule::AllDone => {
                    needed.extend(earlier.after.iter().map(of_id).flat_map(|task| {
                        [record_path, log_path].map(|path| path(Path::new(""), task))
                    }))
                }
            }
        }
        needed.iter().try_for_each(|path| self.fetch(path))?;
        let before = match task.trigger_rule {
            TriggerRule::AllSuccess => task.after.as_slice(),
            TriggerRule::AllDone => &[],
        };
        let mut read = before.iter().map(of_id).chain([task]);
        read.try_for_each(|task| self.fetch_outputs(task))
    }

    /// Fetches all inputs, records and results of a job.
    ///
    /// # Errors
    /// The errors of [`JobFolder::fetch_for`].
    pub fn fetch_all(&self, job: &Job) -> Result<(), JobError> {
        if self.stored.is_none() {
            return Ok(());
        }
        let inputs: BTreeSet<&PathBuf> = job.tasks.iter().flat_map(|task| &task.inputs).collect();
        inputs.into_iter().try_for_each(|path| self.fetch(path))?;
        job.tasks.iter().try_for_each(|task| {
            self.fetch(&record_path(Path::new(""), task))?;
            self.fetch_outputs(task)
        })
    }

    /// Fetches the outputs of a task that is done. Without a record, those of this machine are
    /// where an attempt goes on that was interrupted.
    fn fetch_outputs(&self, task: &Task) -> Result<(), JobError> {
        if record_path(&self.path, task).is_file() {
            task.outputs.iter().try_for_each(|path| self.fetch(path))?;
        }
        Ok(())
    }

    /// Puts the results of a task on the storage, its record last.
    ///
    /// # Errors
    /// Storage that refuses or fails.
    pub fn put_results(&self, task: &Task) -> Result<(), JobError> {
        task.outputs.iter().try_for_each(|path| self.put(path))?;
        self.put(&log_path(Path::new(""), task))?;
        self.put(&record_path(Path::new(""), task))
    }

    /// Puts the log of a task that failed on the storage, which then has no record of it.
    ///
    /// # Errors
    /// Storage that refuses or fails.
    pub fn put_failure(&self, task: &Task) -> Result<(), JobError> {
        if let Some((mirror, url)) = &self.stored {
            mirror.delete(&url.join(&record_path(Path::new(""), task))?)?;
        }
        self.put(&log_path(Path::new(""), task))
    }

    /// Fetches a file or folder of a path from that of the job, if it is on the storage.
    fn fetch(&self, path: &Path) -> Result<(), JobError> {
        // What has an address of its own is fetched by those that open it.
        if let Some((mirror, url)) = &self.stored
            && StorageUrl::of(path)?.is_none()
        {
            mirror.fetch(&url.join(path)?)?;
        }
        Ok(())
    }

    fn put(&self, path: &Path) -> Result<(), JobError> {
        if let Some((mirror, url)) = &self.stored {
            mirror.put(&url.join(path)?)?;
        }
        Ok(())
    }
}
