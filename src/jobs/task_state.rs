//! The state of a task as its last attempt left it, whatever its inputs are now.

use super::error::JobError;
use super::job::Task;
use super::task_record::{TaskRecord, error_of_log, log_path};
use std::path::{Path, PathBuf};

/// The state of a task.
#[derive(Clone, Debug, PartialEq)]
pub enum TaskState {
    /// Its last attempt was done.
    Done(TaskRecord),
    /// Its last attempt failed, or is running.
    Failed {
        /// The reason.
        reason: String,
    },
    /// It has not been run.
    NotRun,
}

impl TaskState {
    /// Reads the state of a task of the job in `folder`.
    ///
    /// # Errors
    /// A record that cannot be read.
    pub fn read(folder: &Path, task: &Task) -> Result<Self, JobError> {
        if let Some(record) = TaskRecord::read(folder, task)? {
            return Ok(Self::Done(record));
        }
        let log = log_path(folder, task);
        if !log.is_file() {
            return Ok(Self::NotRun);
        }
        // Not with the folder's own path: the text is the same on all machines.
        let reason = error_of_log(&log).unwrap_or_else(|| {
            let log = log_path(&PathBuf::new(), task);
            format!("it has not come to its end; see {}", log.display())
        });
        Ok(Self::Failed { reason })
    }
}

#[cfg(test)]
mod tests {
    use super::super::job::tests::task;
    use super::*;
    use crate::persist::atomic::write_text;

    #[test]
    fn a_log_without_a_record_is_that_of_a_failure() {
        let dir = tempfile::tempdir().unwrap();
        let task = task("a.refine", &[]);
        let state = || TaskState::read(dir.path(), &task).unwrap();
        assert_eq!(state(), TaskState::NotRun);
        for (text, expected) in [
            (
                "reading\n",
                "it has not come to its end; see logs/a.refine.log",
            ),
            ("error: one\nerror: no frames\n", "no frames"),
        ] {
            let log = log_path(dir.path(), &task);
            std::fs::create_dir_all(log.parent().unwrap()).unwrap();
            write_text(&log, text).unwrap();
            let reason = expected.to_owned();
            assert_eq!(state(), TaskState::Failed { reason });
        }
    }
}
