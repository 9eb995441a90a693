//! All tasks of a job, on this machine.

use super::error::JobError;
use super::job::Job;
use super::job_folder::JobFolder;
use super::process::output_of;
use super::run_task::{NOT_USABLE, TEMPORARY, read_records};
use super::schedule::{Machine, Schedule};
use crate::progress::Progress;
use serde::Serialize;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::mpsc;

/// The end of a task.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "outcome")]
pub enum TaskOutcome {
    /// It was done before.
    UpToDate,
    /// It is done.
    Done,
    /// It is done, now or before, but its result may not be used.
    NotUsable,
    /// It failed.
    Failed {
        /// Exit code.
        exit_code: u8,
        /// The reason.
        what: String,
    },
    /// It comes after one that failed, or whose result may not be used.
    Skipped {
        /// That one.
        because_of: String,
    },
}

/// The end of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct JobSummary {
    /// Task by task.
    pub tasks: Vec<TaskEnd>,
}

/// A task and its end.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TaskEnd {
    /// The task.
    pub id: String,
    /// Its end.
    #[serde(flatten)]
    pub outcome: TaskOutcome,
}

/// Runs the tasks of the job in `folder` that are not done, by `program` (its `run-task`), as many
/// at a time as fit on the machine. After a failure, what does not come after it goes on.
///
/// # Errors
/// An input or a record that cannot be read before the first task begins.
pub fn run_job(
    folder: &JobFolder,
    job: &Job,
    program: &Path,
    machine: Machine,
    progress: &dyn Progress,
) -> Result<JobSummary, JobError> {
    let records = read_records(folder.path(), job)?;
    let mut outcomes: Vec<Option<TaskOutcome>> = vec![None; job.tasks.len()];
    let is_done: Vec<bool> = records.iter().map(Option::is_some).collect();
    let mut schedule = Schedule::new(job, machine, &is_done);
    for (k, record) in records.iter().enumerate() {
        if let Some(record) = record {
            let is_usable = record.exit_code != NOT_USABLE;
            let outcome = match is_usable {
                true => TaskOutcome::UpToDate,
                false => TaskOutcome::NotUsable,
            };
            let lost = schedule.end(k, is_usable);
            note(job, &mut outcomes, k, outcome, &lost);
        }
    }
    let waiting = outcomes.iter().filter(|outcome| outcome.is_none()).count();
    progress.start("job", waiting);
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        let mut running = 0usize;
        loop {
            while let Some(k) = schedule.start_next() {
                let id = job.tasks[k].id.as_str();
                progress.detail(id);
                let sender = sender.clone();
                running += 1;
                // The receiver lives longer than all threads.
                scope.spawn(move || sender.send((k, call(program, folder.given(), id))));
            }
            if running == 0 {
                break;
            }
            let Ok((k, outcome)) = receiver.recv() else {
                break;
            };
            running -= 1;
            let is_good = matches!(outcome, TaskOutcome::Done | TaskOutcome::UpToDate);
            let lost = schedule.end(k, is_good);
            progress.advance(1 + lost.len());
            note(job, &mut outcomes, k, outcome, &lost);
        }
    });
    progress.finish();
    let ends = job.tasks.iter().zip(outcomes);
    let tasks = ends.filter_map(|(task, outcome)| {
        let id = task.id.clone();
        outcome.map(|outcome| TaskEnd { id, outcome })
    });
    Ok(JobSummary {
        tasks: tasks.collect(),
    })
}

/// Notes the end of a task, and of those that are lost with it.
fn note(
    job: &Job,
    outcomes: &mut [Option<TaskOutcome>],
    k: usize,
    outcome: TaskOutcome,
    lost: &[usize],
) {
    outcomes[k] = Some(outcome);
    for later in lost {
        outcomes[*later] = Some(TaskOutcome::Skipped {
            because_of: job.tasks[k].id.clone(),
        });
    }
}

/// Calls `run-task` for a task.
fn call(program: &Path, folder: &Path, id: &str) -> TaskOutcome {
    let mut command = Command::new(program);
    command.arg("run-task").arg(folder).args([id, "--quiet"]);
    match output_of(&mut command) {
        Ok(output) => outcome_of(&output),
        Err(error) => TaskOutcome::Failed {
            exit_code: 1,
            what: format!("cannot start the program: {error}"),
        },
    }
}

fn outcome_of(output: &Output) -> TaskOutcome {
    // Without a code it was ended by a signal.
    let code = output.status.code().unwrap_or(i32::from(TEMPORARY));
    match u8::try_from(code).unwrap_or(1) {
        0 => TaskOutcome::Done,
        NOT_USABLE => TaskOutcome::NotUsable,
        exit_code => {
            let text = String::from_utf8_lossy(&output.stderr);
            let text = text.trim();
            let what = text.strip_prefix("error: ").unwrap_or(text).to_owned();
            TaskOutcome::Failed { exit_code, what }
        }
    }
}
