//! A process whose output goes to a log, and which is ended after a limit of time.

use crate::files::open_without_links;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Longest pause between two looks at a process.
const MAX_PAUSE: Duration = Duration::from_millis(100);
/// Time that a process has to remove unfinished files once it is to end.
const GRACE: Duration = Duration::from_secs(5);
/// Start of the names of variables with options of this program. They are no part of a task, so
/// they do not reach it.
const OPTION_VARIABLES: &str = "TUNNELSTITCH_";
/// Variable with the number of threads, on which no result depends.
const THREADS_VARIABLE: &str = "TUNNELSTITCH_THREADS";

/// Option of the calls that put shards together.
const JOIN_OPTION: &str = "--join";
/// Variables of the C library of Linux that return memory to the system once it is free, instead of
/// keeping it in pieces: without them a task that joins shards, which has the equations of all
/// frames, has a fifth more at its peak. Others have room, and it takes time. Bytes.
const ALLOCATOR_VARIABLES: [&str; 2] = ["MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"];
/// Their value: allocations that large are few and take long to fill.
const ALLOCATOR_THRESHOLD: &str = "1048576";

/// Identifiers of the processes that run.
static RUNNING: Mutex<BTreeSet<u32>> = Mutex::new(BTreeSet::new());

/// The end of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It ended with this exit code.
    Exit(u8),
    /// It was ended by this signal.
    Signal(i32),
    /// It was ended after its limit of time.
    TimeLimit,
}

/// Time, processor time and memory of a process.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Usage {
    /// Time from start to end, seconds.
    pub seconds: f64,
    /// Processor time, seconds; None where the system does not tell.
    pub processor_seconds: Option<f64>,
    /// Largest memory, bytes; None where the system does not tell.
    pub peak_bytes: Option<u64>,
}

/// Runs `program` in `folder` with its output in `log`, on `cores` threads, for `limit` at the
/// most.
///
/// # Errors
/// A log that cannot be written; a program that cannot be started.
pub fn run_process(
    [program, folder, log]: [&Path; 3],
    arguments: &[String],
    cores: u16,
    limit: Duration,
) -> io::Result<(Ending, Usage)> {
    let output = open_without_links(log)?;
    output.set_len(0)?;
    let begin = Instant::now();
    let mut command = Command::new(program);
    let is_option =
        |name: &std::ffi::OsStr| (name.as_encoded_bytes()).starts_with(OPTION_VARIABLES.as_bytes());
    for (name, _) in std::env::vars_os().filter(|(name, _)| is_option(name)) {
        command.env_remove(name);
    }
    command
        .args(arguments)
        .current_dir(folder)
        .env(THREADS_VARIABLE, cores.to_string())
        .stdin(Stdio::null())
        .stdout(output.try_clone()?)
        .stderr(output);
    if arguments.iter().any(|word| word == JOIN_OPTION) {
        command.envs(ALLOCATOR_VARIABLES.map(|name| (name, ALLOCATOR_THRESHOLD)));
    }
    let mut child = command.spawn()?;
    running().insert(child.id());
    let ending = wait(&mut child, begin, limit);
    running().remove(&child.id());
    let (processor_seconds, peak_bytes) = children_usage();
    let usage = Usage {
        seconds: begin.elapsed().as_secs_f64(),
        processor_seconds,
        peak_bytes,
    };
    Ok((ending?, usage))
}

/// Runs a command to its end and returns its output.
///
/// # Errors
/// A program that cannot be started.
pub fn output_of(command: &mut Command) -> io::Result<Output> {
    let child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let id = child.id();
    running().insert(id);
    let output = child.wait_with_output();
    running().remove(&id);
    output
}

/// Asks all processes that run to end, which removes their unfinished files. For a program that is
/// interrupted itself.
pub fn end_processes() {
    running().iter().copied().for_each(ask_to_end);
}

fn running() -> MutexGuard<'static, BTreeSet<u32>> {
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits for a process, and ends it after the limit.
fn wait(child: &mut Child, begin: Instant, limit: Duration) -> io::Result<Ending> {
    if let Some(status) = wait_until(child, begin + limit)? {
        return Ok(ending_of(status));
    }
    ask_to_end(child.id());
    if wait_until(child, Instant::now() + GRACE)?.is_none() {
        child.kill()?;
        child.wait()?;
    }
    Ok(Ending::TimeLimit)
}

fn wait_until(child: &mut Child, deadline: Instant) -> io::Result<Option<ExitStatus>> {
    let mut pause = Duration::from_millis(1);
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline {
            return Ok(None);
        }
        std::thread::sleep(pause);
        pause = (2 * pause).min(MAX_PAUSE);
    }
}

#[cfg(unix)]
fn ending_of(status: ExitStatus) -> Ending {
    use std::os::unix::process::ExitStatusExt;
    match status.signal() {
        Some(signal) => Ending::Signal(signal),
        None => exit_of(status),
    }
}

#[cfg(not(unix))]
fn ending_of(status: ExitStatus) -> Ending {
    exit_of(status)
}

fn exit_of(status: ExitStatus) -> Ending {
    // A code that is none of this program's is that of a bug.
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ending::Exit(code.unwrap_or(1))
}

#[cfg(unix)]
fn ask_to_end(id: u32) {
    use nix::sys::signal::{Signal, kill};
    if let Ok(id) = i32::try_from(id) {
        // It may have ended by itself.
        let _ = kill(nix::unistd::Pid::from_raw(id), Signal::SIGTERM);
    }
}

#[cfg(not(unix))]
fn ask_to_end(_id: u32) {}

/// Processor time (seconds) and largest memory (bytes) of the processes that have ended.
#[cfg(unix)]
fn children_usage() -> (Option<f64>, Option<u64>) {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike;
    let Ok(usage) = getrusage(UsageWho::RUSAGE_CHILDREN) else {
        return (None, None);
    };
    let time = usage.user_time() + usage.system_time();
    // Linux counts KiB, macOS bytes.
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    let peak = u64::try_from(usage.max_rss()).ok();
    let seconds = 1e-6 * time.num_microseconds() as f64;
    (Some(seconds), peak.map(|peak| peak * unit))
}

#[cfg(not(unix))]
fn children_usage() -> (Option<f64>, Option<u64>) {
    (None, None)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn run(script: &str, limit: Duration) -> (Ending, String) {
        let dir = tempfile::tempdir().unwrap();
        let log = dir.path().join("log");
        let arguments = ["-c".to_owned(), script.to_owned()];
        let places = [Path::new("/bin/sh"), dir.path(), &log];
        let (ending, usage) = run_process(places, &arguments, 3, limit).unwrap();
        assert!(usage.peak_bytes.unwrap() > 0 && usage.seconds > 0.0);
        (ending, std::fs::read_to_string(log).unwrap())
    }

    #[test]
    fn its_output_is_a_log_and_its_end_is_told() {
        let long = Duration::from_secs(60);
        let script = "echo out; echo $TUNNELSTITCH_THREADS >&2; exit 3";
        let (ending, log) = run(script, long);
        assert_eq!((ending, log.as_str()), (Ending::Exit(3), "out\n3\n"));
        assert_eq!(run("kill -9 $$", long).0, Ending::Signal(9));
    }

    #[test]
    fn what_does_not_end_is_ended() {
        let begin = Instant::now();
        let (ending, _) = run("exec sleep 60", Duration::from_millis(50));
        assert_eq!(ending, Ending::TimeLimit);
        assert!(begin.elapsed() < Duration::from_secs(30));
    }
}
