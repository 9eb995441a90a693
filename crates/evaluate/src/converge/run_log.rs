//! Log of finished runs, runs.jsonl: one run per line.

use crate::converge::error::ConvergeError;
use crate::converge::run_record::{RunRecord, Settings};
use crate::converge::sweep_cell::SweepCell;
use std::collections::HashMap;
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tunnelstitch_core::persist::atomic::WriteError;
use tunnelstitch_geometry::files::limits::MAX_TABLE_BYTES;
use tunnelstitch_geometry::files::open_without_links;
use tunnelstitch_geometry::files::regular::{open_regular, read_limited};

/// Start of every line.
const LINE_START: &[u8] = b"{\"schema_version\":";

/// Open log of a sweep, to which runs are appended.
///
/// It is never rewritten, so that finished runs survive any end of the program.
#[derive(Debug)]
pub(super) struct RunLog {
    path: PathBuf,
    file: File,
    runs: Runs,
}

impl RunLog {
    /// Opens or creates the log; `discard` removes all its runs.
    ///
    /// A last line without a line break is the rest of an interrupted run; it is removed, and the
    /// run is repeated. Runs of other cells or seeds than the sweep's may be in the log and stay.
    ///
    /// # Errors
    /// [`ConvergeError::Log`] for runs of other settings, for lines that are not runs, and if
    /// another program has the log open; [`ConvergeError::Write`].
    pub fn open(path: &Path, settings: &Settings, discard: bool) -> Result<Self, ConvergeError> {
        let fail = |source| ConvergeError::from(WriteError::new(path, source));
        let mut file = open_without_links(path).map_err(fail)?;
        lock(&file, path)?;
        if discard {
            file.set_len(0).map_err(fail)?;
        }
        let (runs, end) = read_runs(&file, path, settings)?;
        file.set_len(end as u64).map_err(fail)?;
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            runs,
        })
    }

    /// The finished run of a cell and seed, if any.
    pub fn find(&self, cell: &SweepCell, seed: u64) -> Option<&RunRecord> {
        self.runs.get(&(cell.key(), seed))
    }

    /// Appends a finished run and flushes it to the disk.
    ///
    /// # Errors
    /// [`WriteError`] if the log cannot be written.
    pub fn append(&mut self, run: RunRecord) -> Result<(), WriteError> {
        let fail = |source| WriteError::new(&self.path, source);
        let mut line =
            serde_json::to_vec(&run).map_err(|error| fail(std::io::Error::other(error)))?;
        line.push(b'\n');
        self.file.write_all(&line).map_err(fail)?;
        self.file.sync_data().map_err(fail)?;
        self.runs.insert((run.cell.key(), run.seed), run);
        Ok(())
    }
}

/// Number of the `wanted` runs that [`RunLog::open`] would find in the log, which stays as it is.
///
/// # Errors
/// The errors of [`RunLog::open`].
pub(super) fn count_finished<'a>(
    path: &Path,
    settings: &Settings,
    wanted: impl Iterator<Item = (&'a SweepCell, u64)>,
) -> Result<usize, ConvergeError> {
    let file = match open_regular(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(0),
        Err(error) => return Err(WriteError::new(path, error).into()),
    };
    lock(&file, path)?;
    let (runs, _) = read_runs(&file, path, settings)?;
    let is_finished = |run: &(&SweepCell, u64)| runs.contains_key(&(run.0.key(), run.1));
    Ok(wanted.filter(is_finished).count())
}

/// Locks the log, as long as the file is open.
fn lock(file: &File, path: &Path) -> Result<(), ConvergeError> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(ConvergeError::Log {
            path: path.to_owned(),
            what: "another sweep is at work here; wait for it, or choose another folder".to_owned(),
        }),
        // Some file systems do not support locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

/// Finished runs by cell and seed.
type Runs = HashMap<(String, u64), RunRecord>;

/// Reads the runs of a log; returns them with the length of their lines, bytes.
fn read_runs(
    file: &File,
    path: &Path,
    settings: &Settings,
) -> Result<(Runs, usize), ConvergeError> {
    let bytes = read_limited(file, MAX_TABLE_BYTES);
    let bytes = bytes.map_err(|source| WriteError::new(path, source))?;
    let end = bytes
        .iter()
        .rposition(|byte| *byte == b'\n')
        .map_or(0, |k| k + 1);
    let (lines, rest) = bytes.split_at(end);
    let runs = parse_runs(lines, settings).and_then(|runs| {
        if is_line_start(rest) {
            Ok(runs)
        } else {
            Err("its end is no run".to_owned())
        }
    });
    let runs = runs.map_err(|what| ConvergeError::Log {
        path: path.to_owned(),
        what: format!(
            "{what}; choose another folder, or drop the runs that are there with --force"
        ),
    })?;
    Ok((runs, end))
}

/// Parses the runs of complete lines; of two runs of the same cell and seed, the last counts.
///
/// # Errors
/// A description of the first line that is not a run of this sweep.
fn parse_runs(lines: &[u8], settings: &Settings) -> Result<Runs, String> {
    let mut runs = HashMap::new();
    for (index, line) in lines.split(|byte| *byte == b'\n').enumerate() {
        if line.is_empty() {
            continue;
        }
        let number = index + 1;
        // The settings first, since a line of another version may lack fields of a run.
        let there: Settings = serde_json::from_slice(line)
            .map_err(|error| format!("line {number} is no run: {error}"))?;
        if let Some(difference) = settings.difference(&there) {
            return Err(format!("it holds runs of another sweep: {difference}"));
        }
        let run: RunRecord = serde_json::from_slice(line)
            .map_err(|error| format!("line {number} is no run: {error}"))?;
        runs.insert((run.cell.key(), run.seed), run);
    }
    Ok(runs)
}

/// True if `rest` may be the start of a line of the log.
fn is_line_start(rest: &[u8]) -> bool {
    let common = rest.len().min(LINE_START.len());
    rest[..common] == LINE_START[..common]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::converge::options::ConvergeOptions;
    use crate::converge::run_record::tests::record;

    fn settings() -> Settings {
        ConvergeOptions::default().settings()
    }

    fn message(path: &Path, settings: &Settings) -> String {
        RunLog::open(path, settings, false).unwrap_err().to_string()
    }

    #[test]
    fn a_truncated_last_line_is_removed_and_the_rest_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("runs.jsonl");
        let mut log = RunLog::open(&path, &settings(), false).unwrap();
        for seed in [1, 2] {
            log.append(record(0.7, seed)).unwrap();
        }
        drop(log);
        let (cell, other) = (record(0.7, 1).cell, record(0.8, 1).cell);
        let wanted = [(&cell, 1), (&cell, 3), (&other, 1)];
        let finished = |path: &Path| count_finished(path, &settings(), wanted.into_iter());
        assert_eq!(finished(&path).unwrap(), 1);
        assert_eq!(finished(&dir.path().join("none")).unwrap(), 0);
        let whole = std::fs::read(&path).unwrap();
        assert!(whole.starts_with(LINE_START));
        let first_end = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        for cut in [whole.len() - 1, first_end + 40, first_end + 3, first_end] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let mut log = RunLog::open(&path, &settings(), false).unwrap();
            assert_eq!(log.find(&record(0.7, 1).cell, 1), Some(&record(0.7, 1)));
            assert_eq!(log.find(&record(0.7, 2).cell, 2), None);
            log.append(record(0.7, 2)).unwrap();
            drop(log);
            assert_eq!(std::fs::read(&path).unwrap(), whole);
        }
    }

    #[test]
    fn runs_of_other_settings_are_refused_with_the_remedy_and_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("runs.jsonl");
        let mut log = RunLog::open(&path, &settings(), false).unwrap();
        log.append(record(2.0, 1)).unwrap();
        drop(log);
        let written = std::fs::read(&path).unwrap();
        let other = Settings {
            frames: 12,
            ..settings()
        };
        let refused = message(&path, &other);
        assert!(
            refused.contains("frames is 24 there and 12 here") && refused.contains("--force"),
            "{refused}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), written);
        let log = RunLog::open(&path, &other, true).unwrap();
        assert!(log.runs.is_empty());
        assert_eq!(std::fs::read(&path).unwrap().len(), 0);
    }

    #[test]
    fn a_file_that_is_not_a_log_is_not_touched() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("runs.jsonl");
        for text in [
            "my notes",
            "{\"a\": 1}\n",
            "{\"schema_version\":1}\n{\"schema",
        ] {
            std::fs::write(&path, text).unwrap();
            let refused = message(&path, &settings());
            assert!(refused.contains("no run"), "{refused}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }

    #[test]
    fn two_sweeps_do_not_write_into_one_log() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("runs.jsonl");
        let _first = RunLog::open(&path, &settings(), false).unwrap();
        assert!(message(&path, &settings()).contains("another sweep"));
    }
}
