//! `state/ID.json`: the record of a task that is done.

use super::error::JobError;
use super::job::Task;
use super::process::Usage;
use super::text_file;
use crate::files::read_text;
use crate::persist::atomic::{self, WriteError};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Folder of the records in that of the job.
const STATE_FOLDER: &str = "state";
/// Folder of the logs in that of the job.
const LOG_FOLDER: &str = "logs";
/// Largest size of a record, bytes.
const MAX_BYTES: u64 = 1 << 16;
/// Largest size of a log that is searched for the reason of a failure, bytes.
const MAX_LOG_BYTES: u64 = 1 << 20;

/// The record of a task that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskRecord {
    /// The key with which it was done.
    pub key: String,
    /// Name and version of the program.
    pub program: String,
    /// Exit code of the command: 0, or 4 if the result may not be used.
    pub exit_code: u8,
    /// Time, processor time and memory.
    #[serde(flatten)]
    pub usage: Usage,
}

impl TaskRecord {
    /// Reads the record of a task; None if it has none.
    ///
    /// # Errors
    /// A record that cannot be read.
    pub fn read(folder: &Path, task: &Task) -> Result<Option<Self>, JobError> {
        let path = record_path(folder, task);
        let text = match read_text(&path, MAX_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(source) => {
                return Err(JobError::Read {
                    path,
                    source,
                    remedy: "; remove it to run the task again",
                });
            }
        };
        let record = serde_json::from_str(&text);
        record
            .map(Some)
            .map_err(|error| text_file::json_error(&path, &error))
    }

    /// Writes the record.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path, task: &Task) -> Result<(), WriteError> {
        text_file::write_json(&record_path(folder, task), self)
    }

    /// Removes the record of a task, if it has one.
    ///
    /// # Errors
    /// A file that cannot be removed.
    pub fn remove(folder: &Path, task: &Task) -> Result<(), WriteError> {
        atomic::remove_file(&record_path(folder, task))
    }
}

/// The record of a task.
pub fn record_path(folder: &Path, task: &Task) -> PathBuf {
    folder.join(STATE_FOLDER).join(format!("{}.json", task.id))
}

/// The file that is locked while a task runs.
pub fn lock_path(folder: &Path, task: &Task) -> PathBuf {
    folder.join(STATE_FOLDER).join(format!("{}.lock", task.id))
}

/// The log of a task.
pub fn log_path(folder: &Path, task: &Task) -> PathBuf {
    folder.join(LOG_FOLDER).join(format!("{}.log", task.id))
}

/// The last error of a log; None if it has none.
pub fn error_of_log(log: &Path) -> Option<String> {
    let text = read_text(log, MAX_LOG_BYTES).unwrap_or_default();
    let mut lines = text.lines().rev();
    let error = lines.find_map(|line| line.strip_prefix("error: "));
    error.map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::super::job::tests::task;
    use super::*;

    #[test]
    fn a_record_is_read_as_written_and_what_is_none_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let task = task("a.refine", &[]);
        assert_eq!(TaskRecord::read(dir.path(), &task).unwrap(), None);
        let record = TaskRecord {
            key: "abc".to_owned(),
            program: "tunnelstitch 0".to_owned(),
            exit_code: 4,
            usage: Usage {
                seconds: 1.5,
                processor_seconds: Some(2.5),
                peak_bytes: None,
            },
        };
        record.write(dir.path(), &task).unwrap();
        assert_eq!(TaskRecord::read(dir.path(), &task).unwrap(), Some(record));
        std::fs::write(record_path(dir.path(), &task), "{").unwrap();
        let message = TaskRecord::read(dir.path(), &task).unwrap_err().to_string();
        assert!(message.contains("a.refine.json:1:1"), "{message}");
    }
}
