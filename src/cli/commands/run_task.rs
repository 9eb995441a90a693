//! `tunnelstitch run-task`: runs one task of a job.

use crate::cli::output::{Failure, Terminal, duration_text, own_program};
use crate::jobs::{DoneTask, Job, JobError, JobFolder, TaskRecord, run_task};
use serde::Serialize;
use std::path::PathBuf;

/// Runs one task of a job, on any machine that sees its files, unless it is done.
///
/// For engines that run the tasks of a job on many machines. A task may be run again at any time:
/// it does nothing if it was done with its present inputs. What its command prints is in
/// logs/TASK.log; state/TASK.json is the record.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes:\n  \
    0   done, now or before\n  \
    3   failed, and would fail again (1, 2: likewise)\n  \
    4   done, but the result may not be used\n  \
    75  failed, but may succeed later or elsewhere\n\n\
    Example:\n  tunnelstitch run-task job K12-K13.refine")]
pub struct RunTaskArguments {
    /// Folder that plan-job has written, or its address on storage (s3://bucket/folder).
    job: PathBuf,
    /// Identifier of the task in job.json.
    task: String,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the job, its inputs, or the command of the task.
pub fn run(arguments: &RunTaskArguments, terminal: &Terminal) -> Result<(), Failure> {
    let folder = JobFolder::new(&arguments.job)?;
    let job = folder.read_job()?;
    let task = &arguments.task;
    let done = run_in(&folder, &job, task)?;
    let DoneTask {
        record,
        is_up_to_date,
    } = &done;
    terminal.say(match is_up_to_date {
        true => format!("{task}: up to date"),
        false => format!("{task}: done in {}", duration_text(record.usage.seconds)),
    });
    terminal.result(&TaskReport {
        task,
        up_to_date: *is_up_to_date,
        record,
    })?;
    match record.exit_code {
        0 => Ok(()),
        _ => Err(Failure::quality(format!(
            "task {task}: its result may not be used; logs/{task}.log says why"
        ))),
    }
}

/// Runs the task with what the storage has, if the job is there; its results go there.
fn run_in(folder: &JobFolder, job: &Job, id: &str) -> Result<DoneTask, Failure> {
    let task = job.task(folder.path(), id)?;
    folder.fetch_for(job, task)?;
    let run = run_task(folder.path(), job, id, &own_program()?);
    match &run {
        Ok(done) if done.is_up_to_date => {}
        Ok(_) => folder.put_results(task)?,
        Err(JobError::Failed { .. }) => folder.put_failure(task)?,
        Err(_) => {}
    }
    Ok(run?)
}

/// The result, for `--json`.
#[derive(Serialize)]
struct TaskReport<'a> {
    task: &'a str,
    up_to_date: bool,
    #[serde(flatten)]
    record: &'a TaskRecord,
}
