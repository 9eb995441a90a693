//! `tunnelstitch run-job`: runs the tasks of a job on this machine.

use crate::cli::output::{DryRunArguments, Failure, Terminal, own_program};
use crate::files::printed;
use crate::jobs::{
    Job, JobFolder, JobSummary, Machine, TaskEnd, TaskOutcome, read_records, run_job,
};
use crate::render::available_bytes;
use serde::Serialize;
use std::path::PathBuf;

/// Runs the tasks of a job on this machine: those that are not done, as many at a time as
/// processors and memory allow.
///
/// After a failure, everything that does not come after it goes on. After Ctrl-C, a crash or a
/// change of an input, the same command runs just what is missing.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  tunnelstitch plan-job network.toml --out job\n  \
    tunnelstitch run-job job"
)]
pub struct RunJobArguments {
    /// Folder that plan-job has written, or its address on storage (s3://bucket/folder).
    job: PathBuf,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the job; of the first task that failed, if there is one.
pub fn run(arguments: &RunJobArguments, terminal: &Terminal) -> Result<(), Failure> {
    let folder = JobFolder::new(&arguments.job)?;
    let job = folder.read_job()?;
    folder.fetch_all(&job)?;
    if arguments.dry_run.is_set() {
        return print_states(&folder, &job, terminal);
    }
    let machine = Machine {
        cores: rayon::current_num_threads(),
        memory_bytes: available_bytes(),
    };
    let summary = run_job(&folder, &job, &own_program()?, machine, terminal)?;
    let failures = print_ends(&summary, terminal);
    terminal.result(&summary)?;
    match failures {
        None => Ok(()),
        Some(code) => Err(Failure {
            message: format!(
                "not all tasks of {} are done; the same command runs just what is missing",
                printed(folder.given())
            ),
            code,
        }),
    }
}

/// Prints the ends of the tasks; returns the exit code of the first that is not done.
fn print_ends(summary: &JobSummary, terminal: &Terminal) -> Option<u8> {
    let ends = &summary.tasks;
    let count = |is_one: fn(&TaskOutcome) -> bool| {
        let ends = ends.iter().filter(|end| is_one(&end.outcome));
        ends.count()
    };
    let mut code = None;
    for TaskEnd { id, outcome } in ends {
        match outcome {
            TaskOutcome::Done | TaskOutcome::UpToDate => {}
            TaskOutcome::NotUsable => {
                code = code.or(Some(4));
                terminal.warn(format!(
                    "{id}: the result may not be used; logs/{id}.log says why"
                ));
            }
            TaskOutcome::Failed { exit_code, what } => {
                code = code.or(Some(*exit_code));
                terminal.warn(format!("{id}: {what}"));
            }
            TaskOutcome::Skipped { because_of } => {
                terminal.warn(format!("{id}: skipped because of {because_of}"));
            }
        }
    }
    terminal.say(format!(
        "{} of {} tasks are done, {} of them before",
        count(|end| matches!(end, TaskOutcome::Done | TaskOutcome::UpToDate)),
        ends.len(),
        count(|end| matches!(end, TaskOutcome::UpToDate)),
    ));
    code
}

/// A task and its state, for `--dry-run --json`.
#[derive(Serialize)]
struct PlannedTask<'a> {
    id: &'a str,
    is_done: bool,
    seconds: f64,
}

/// Prints which tasks are done and which are not.
fn print_states(folder: &JobFolder, job: &Job, terminal: &Terminal) -> Result<(), Failure> {
    let records = read_records(folder.path(), job)?;
    let tasks = job.tasks.iter().zip(&records);
    let states: Vec<PlannedTask> = tasks
        .map(|(task, record)| PlannedTask {
            id: &task.id,
            is_done: record.is_some(),
            seconds: task.needs.seconds,
        })
        .collect();
    terminal.say("dry run: nothing is run");
    for state in &states {
        let text = if state.is_done { "done" } else { "would run" };
        terminal.say(format!("  {text:<10}{}", state.id));
    }
    terminal.result(&states)
}
