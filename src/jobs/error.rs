//! Errors of jobs.

use crate::files::printed;
use crate::persist::atomic::WriteError;
use crate::persist::provenance::HashError;
use crate::storage::StorageError;
use crate::survey::SurveyError;
use std::path::PathBuf;

/// A job that cannot be planned, read or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// A file cannot be read.
    #[error("{}: cannot read: {source}{remedy}", printed(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
        /// The remedy, after a semicolon, if there is one.
        remedy: &'static str,
    },
    /// A file is malformed or has an unknown key.
    #[error("{}:{line}:{column}: {what}", printed(path))]
    Parse {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// The error of the parser.
        what: String,
    },
    /// A value is impossible.
    #[error("{}: {what}", printed(path))]
    Value {
        /// The file.
        path: PathBuf,
        /// The value and the remedy.
        what: String,
    },
    /// The survey of a section cannot be opened.
    #[error("section {section}: {source}")]
    Survey {
        /// The section.
        section: String,
        /// The error of the survey.
        source: SurveyError,
    },
    /// An input cannot be read.
    #[error("task {task}: {source}")]
    Input {
        /// The task.
        task: String,
        /// The input and the error of the operating system.
        source: HashError,
    },
    /// Storage cannot be used.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The job has no such task.
    #[error("{}: has no task {task:?}{nearest}", printed(path))]
    NoSuchTask {
        /// The job's file.
        path: PathBuf,
        /// The identifier.
        task: String,
        /// The tasks of that section or step, as a clause, if there are some.
        nearest: String,
    },
    /// A task comes after one that is not done.
    #[error(
        "task {task} comes after {after}, which is not done with its present inputs; run it first"
    )]
    NotReady {
        /// The task.
        task: String,
        /// The one before.
        after: String,
    },
    /// The task is running already.
    #[error("task {task} is running already; wait for it to end")]
    Busy {
        /// The task.
        task: String,
    },
    /// The command of a task failed.
    #[error("task {task}: {what}; see {}", printed(log))]
    Failed {
        /// The task.
        task: String,
        /// The reason.
        what: String,
        /// Exit code of the task.
        code: u8,
        /// The log.
        log: PathBuf,
    },
    /// The program cannot be started.
    #[error("task {task}: cannot start {}: {source}", printed(program))]
    Start {
        /// The task.
        task: String,
        /// The program.
        program: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
}
