//! A network of surveys, and a job with the record of its first task after a zero byte; the first
//! byte selects.

use super::super::file;
use tunnelstitch::jobs::{JOB_FILE, Job, Network, TaskRecord};

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    if first % 2 == 0 {
        let (_folder, path) = file("network.toml", content);
        let _ = Network::read(&path);
        return;
    }
    let mut parts = content.splitn(2, |byte| *byte == 0);
    let (folder, _path) = file(JOB_FILE, parts.next().unwrap_or_default());
    let Ok(job) = Job::read(folder.path()) else {
        return;
    };
    let Some(task) = job.tasks.first() else {
        return;
    };
    // What was read can be written and read again.
    let again = tempfile::tempdir().unwrap();
    job.write(again.path()).unwrap();
    assert_eq!(Job::read(again.path()).unwrap(), job);
    let Some(text) = parts.next() else { return };
    let state = folder.path().join("state");
    std::fs::create_dir(&state).unwrap();
    std::fs::write(state.join(format!("{}.json", task.id)), text).unwrap();
    let _ = TaskRecord::read(folder.path(), task);
}
