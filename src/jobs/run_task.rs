//! One task: nothing to do, or its command and the record of it.

use super::error::JobError;
use super::job::{Job, Task, TriggerRule};
use super::process::{Ending, run_process};
use super::task_key::TaskKeys;
use super::task_record::{TaskRecord, error_of_log, lock_path, log_path};
use crate::files::open_without_links;
use crate::persist::atomic::{self, WriteError};
use crate::persist::file_lock::FileLock;
use std::fs::TryLockError;
use std::path::Path;
use std::time::Duration;
use tunnelstitch_core::PROGRAM;

/// Exit code of a command whose result may not be used.
pub const NOT_USABLE: u8 = 4;
/// Exit code of a command that may succeed later.
pub const TEMPORARY: u8 = 75;
/// Exit code of a command that is interrupted.
const INTERRUPTED: u8 = 130;

/// A task that is done.
#[derive(Clone, Debug, PartialEq)]
pub struct DoneTask {
    /// Its record.
    pub record: TaskRecord,
    /// True if it was done before.
    pub is_up_to_date: bool,
}

/// The records of all tasks of a job in `folder`: None for a task that is not done with its present
/// inputs. Nothing is run.
///
/// # Errors
/// An input or a record that cannot be read.
pub fn read_records(folder: &Path, job: &Job) -> Result<Vec<Option<TaskRecord>>, JobError> {
    let mut keys = TaskKeys::new(folder, job);
    let mut records: Vec<Option<TaskRecord>> = Vec::new();
    let places = job.places();
    for task in &job.tasks {
        let record = done(folder, task, &keys.of(task)?)?;
        // What comes after the end of others is done again if one of them has yet to end.
        let mut before = task.after.iter().map(|id| places[id.as_str()]);
        let is_current = match task.trigger_rule {
            TriggerRule::AllSuccess => true,
            TriggerRule::AllDone => before.all(|k| records[k].is_some()),
        };
        records.push(record.filter(|_| is_current));
    }
    Ok(records)
}

/// Runs a task of the job in `folder` by `program`, unless it is done.
///
/// # Errors
/// An input that cannot be read; a task before it that is not done, or whose result may not be
/// used; the same task running already; a command that fails.
pub fn run_task(folder: &Path, job: &Job, id: &str, program: &Path) -> Result<DoneTask, JobError> {
    let task = job.task(folder, id)?;
    // Before any input is read, which may take long.
    let _lock = lock(folder, task)?;
    let mut keys = TaskKeys::new(folder, job);
    let must_be_done = match task.trigger_rule {
        TriggerRule::AllSuccess => task.after.as_slice(),
        TriggerRule::AllDone => &[],
    };
    for after in must_be_done {
        let before = job.task(folder, after)?;
        let record = done(folder, before, &keys.of(before)?)?;
        if record.is_none_or(|record| record.exit_code != 0) {
            return Err(JobError::NotReady {
                task: id.to_owned(),
                after: after.clone(),
            });
        }
    }
    let key = keys.of(task)?;
    if let Some(record) = done(folder, task, &key)? {
        return Ok(DoneTask {
            record,
            is_up_to_date: true,
        });
    }
    // A record of other inputs is none of this attempt.
    TaskRecord::remove(folder, task)?;
    let record = run_command(folder, task, key, program)?;
    record.write(folder, task)?;
    Ok(DoneTask {
        record,
        is_up_to_date: false,
    })
}

/// The record of a task, if it is done with this key, and its outputs are there.
fn done(folder: &Path, task: &Task, key: &str) -> Result<Option<TaskRecord>, JobError> {
    let record = TaskRecord::read(folder, task)?.filter(|record| record.key == key);
    let is_there = |record: &TaskRecord| {
        record.exit_code != 0 || task.outputs.iter().all(|path| folder.join(path).exists())
    };
    Ok(record.filter(is_there))
}

/// Locks a task, so that it runs once.
fn lock(folder: &Path, task: &Task) -> Result<FileLock, JobError> {
    let path = lock_path(folder, task);
    atomic::create_folder(atomic::parent_folder(&path))?;
    let file = open_without_links(&path).map_err(|error| WriteError::new(&path, error))?;
    FileLock::take(file).map_err(|error| match error {
        TryLockError::WouldBlock => JobError::Busy {
            task: task.id.clone(),
        },
        TryLockError::Error(error) => WriteError::new(&path, error).into(),
    })
}

/// Runs the command of a task.
fn run_command(
    folder: &Path,
    task: &Task,
    key: String,
    program: &Path,
) -> Result<TaskRecord, JobError> {
    let log = log_path(folder, task);
    atomic::create_folder(atomic::parent_folder(&log))?;
    for output in &task.outputs {
        atomic::create_folder(atomic::parent_folder(&folder.join(output)))?;
    }
    let limit = Duration::from_secs_f64(task.needs.limit_seconds);
    let places = [program, folder, &log];
    let run = run_process(places, &task.command[1..], task.needs.cores, limit);
    let (ending, usage) = run.map_err(|source| JobError::Start {
        task: task.id.clone(),
        program: program.to_owned(),
        source,
    })?;
    let failed = |code: u8, what: String| JobError::Failed {
        task: task.id.clone(),
        what,
        code,
        log: log.clone(),
    };
    match ending {
        Ending::Exit(exit_code @ (0 | NOT_USABLE)) => {
            let missing = (task.outputs.iter()).find(|path| !folder.join(path).exists());
            match missing.filter(|_| exit_code == 0) {
                Some(path) => Err(failed(
                    1,
                    format!("it ended without writing {}", path.display()),
                )),
                None => Ok(TaskRecord {
                    key,
                    program: PROGRAM.to_owned(),
                    exit_code,
                    usage,
                }),
            }
        }
        Ending::Exit(INTERRUPTED) => Err(failed(TEMPORARY, "it was interrupted".to_owned())),
        Ending::Exit(code) => {
            let reason = error_of_log(&log).unwrap_or_else(|| format!("exit code {code}"));
            Err(failed(code, reason))
        }
        Ending::Signal(signal) => Err(failed(
            TEMPORARY,
            format!("it was ended by signal {signal}{}", likely_cause(signal)),
        )),
        Ending::TimeLimit => Err(failed(
            TEMPORARY,
            format!(
                "it was ended after its limit of {:.0} seconds (needs.limit_seconds)",
                task.needs.limit_seconds
            ),
        )),
    }
}

fn likely_cause(signal: i32) -> &'static str {
    const SIGKILL: i32 = 9;
    match signal {
        SIGKILL => ", as by a system whose memory has ended",
        _ => "",
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::super::job::tests::task;
    use super::*;

    /// A job of two tasks, of which the second copies what the first writes.
    fn job(dir: &Path, first: &str) -> Job {
        std::fs::create_dir_all(dir.join("job")).unwrap();
        std::fs::write(dir.join("in.txt"), "input").unwrap();
        let script = |id: &str, after: &[&str], script: &str| {
            let mut task = task(id, after);
            task.command = ["sh", "-c", script].map(str::to_owned).to_vec();
            task.outputs = vec![format!("a/{id}").into()];
            task
        };
        let job = Job::new(vec![
            script("a.refine", &[], first),
            script("a.stitch", &["a.refine"], "cp a/a.refine a/a.stitch"),
        ]);
        job.write(&dir.join("job")).unwrap();
        job
    }

    fn run(dir: &Path, job: &Job, id: &str) -> Result<DoneTask, String> {
        let folder = dir.join("job");
        let run = run_task(&folder, job, id, Path::new("/bin/sh"));
        run.map_err(|error| error.to_string())
    }

    #[test]
    fn what_is_done_is_not_done_again_until_an_input_changes() {
        let dir = tempfile::tempdir().unwrap();
        let job = job(
            dir.path(),
            "cat ../in.txt > a/a.refine; date +%N >> a/count",
        );
        let message = run(dir.path(), &job, "a.stitch").unwrap_err();
        assert!(message.contains("comes after a.refine"), "{message}");
        let is_new = |id: &str| !run(dir.path(), &job, id).unwrap().is_up_to_date;
        assert!(is_new("a.refine") && !is_new("a.refine"));
        assert!(is_new("a.stitch") && !is_new("a.stitch"));
        let written = dir.path().join("job/a/a.stitch");
        assert_eq!(std::fs::read_to_string(&written).unwrap(), "input");
        std::fs::remove_file(&written).unwrap();
        assert!(!is_new("a.refine") && is_new("a.stitch"));
        std::fs::write(dir.path().join("in.txt"), "other").unwrap();
        assert!(run(dir.path(), &job, "a.stitch").is_err());
        assert!(is_new("a.refine") && is_new("a.stitch"));
        assert_eq!(std::fs::read_to_string(&written).unwrap(), "other");
        let records = read_records(&dir.path().join("job"), &job).unwrap();
        assert!(records.iter().all(Option::is_some));
    }

    #[test]
    fn failures_are_told_with_their_reason_and_leave_no_record() {
        for (script, expected) in [
            ("echo 'error: no frames' >&2; exit 3", "no frames; see"),
            ("exit 1", "exit code 1"),
            ("kill -9 $$", "memory has ended"),
            ("true", "without writing a/a.refine"),
        ] {
            let dir = tempfile::tempdir().unwrap();
            let job = job(dir.path(), script);
            let message = run(dir.path(), &job, "a.refine").unwrap_err();
            assert!(message.contains(expected), "{message}");
            let records = read_records(&dir.path().join("job"), &job).unwrap();
            assert_eq!(records, [None, None]);
        }
    }

    #[test]
    fn a_result_that_may_not_be_used_is_done_and_nothing_comes_after_it() {
        let dir = tempfile::tempdir().unwrap();
        let job = job(dir.path(), "exit 4");
        for is_up_to_date in [false, true] {
            let state = run(dir.path(), &job, "a.refine").unwrap();
            assert_eq!(state.is_up_to_date, is_up_to_date);
            assert_eq!(state.record.exit_code, 4);
        }
        let message = run(dir.path(), &job, "a.stitch").unwrap_err();
        assert!(message.contains("comes after a.refine"), "{message}");
    }

    #[test]
    fn a_task_that_runs_is_not_run_again() {
        let dir = tempfile::tempdir().unwrap();
        let job = job(dir.path(), "true");
        let folder = dir.path().join("job");
        let _lock = lock(&folder, &job.tasks[0]).unwrap();
        let message = run(dir.path(), &job, "a.refine").unwrap_err();
        assert!(message.contains("is running already"), "{message}");
    }
}
