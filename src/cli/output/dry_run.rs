//! The work of a command in words, for `--dry-run`, which does not do it.

use super::duration::duration_text;
use super::failure::Failure;
use super::terminal::Terminal;
use crate::files::printed;
use crate::survey::Survey;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Flag of commands that describe their work instead of doing it.
#[derive(Debug, clap::Args)]
pub struct DryRunArguments {
    /// Check inputs and outputs as for a run, print what would be read and written, and end there:
    /// nothing is written.
    #[arg(long)]
    dry_run: bool,
}

impl DryRunArguments {
    /// True if the work is to be described instead of being done.
    pub fn is_set(&self) -> bool {
        self.dry_run
    }
}

/// The work of a command, after all checks that come before it.
#[derive(Debug, Default, Serialize)]
pub struct Job {
    /// Files that are read, without the frames.
    pub reads: Vec<PathBuf>,
    /// Number of frames that are read.
    pub frames: usize,
    /// Files and folders that are written.
    pub writes: Vec<PathBuf>,
    /// Files that are written only if the result has something for them.
    pub may_write: Vec<PathBuf>,
    /// Width and height of the panorama, pixels.
    pub panorama_px: Option<[u32; 2]>,
    /// Amount of work, in words.
    pub amount: Option<String>,
    /// Memory, bytes; rough.
    pub memory_bytes: Option<u64>,
    /// Time on this machine, seconds; within a factor of two or three.
    pub time_s: Option<f64>,
}

/// The job as `--json` prints it.
#[derive(Serialize)]
struct DryRun<'a> {
    dry_run: bool,
    #[serde(flatten)]
    job: &'a Job,
}

impl Job {
    /// A job that reads a survey and `others`.
    pub fn of<'a>(survey: &'a Survey, others: impl IntoIterator<Item = &'a Path>) -> Self {
        let own = survey.own_files().iter().map(PathBuf::as_path);
        let mut reads: Vec<PathBuf> = Vec::new();
        for path in own.chain(others) {
            if !reads.iter().any(|other| other == path) {
                reads.push(path.to_owned());
            }
        }
        Self {
            reads,
            frames: survey.frames.len(),
            ..Self::default()
        }
    }

    /// Prints the job.
    ///
    /// # Errors
    /// A standard output that is full.
    pub fn print(&self, terminal: &Terminal) -> Result<(), Failure> {
        terminal.say("dry run: nothing is written");
        for (heading, text) in self.rows() {
            terminal.say(format!("  {heading:<12}{text}"));
        }
        terminal.result(&DryRun {
            dry_run: true,
            job: self,
        })
    }

    /// Headings and texts; the heading is left out where it is that of the row before.
    fn rows(&self) -> Vec<(&'static str, String)> {
        let reads = self.reads.iter().map(|path| printed(path).to_string());
        let frames = (self.frames > 0).then(|| format!("{} frames", self.frames));
        let writes = self.writes.iter().map(|path| written(path, ""));
        let may_write = self.may_write.iter().map(|path| written(path, "if found"));
        let subjects: [(&str, Vec<String>); 6] = [
            ("reads", reads.chain(frames).collect()),
            ("writes", writes.chain(may_write).collect()),
            ("panorama", Vec::from_iter(self.panorama_px.map(size))),
            ("work", Vec::from_iter(self.amount.clone())),
            ("memory", Vec::from_iter(self.memory_bytes.map(mebibytes))),
            ("time", Vec::from_iter(self.time_s.map(rough_time))),
        ];
        let rows = subjects.into_iter().flat_map(|(heading, texts)| {
            let headings = std::iter::once(heading).chain(std::iter::repeat(""));
            headings.zip(texts)
        });
        rows.collect()
    }
}

/// The name of an output, with remarks in brackets.
fn written(path: &Path, remark: &str) -> String {
    let exists = if path.exists() { "replaced" } else { "" };
    let remarks = [remark, exists].map(str::to_owned);
    let remarks: Vec<String> = remarks
        .into_iter()
        .filter(|text| !text.is_empty())
        .collect();
    if remarks.is_empty() {
        printed(path).to_string()
    } else {
        format!("{} ({})", printed(path), remarks.join(", "))
    }
}

fn size([width, height]: [u32; 2]) -> String {
    format!("{width} × {height} px")
}

fn mebibytes(bytes: u64) -> String {
    format!("about {} MiB", bytes.div_ceil(1 << 20))
}

fn rough_time(seconds: f64) -> String {
    let text = duration_text(seconds);
    format!("about {text} on this machine, within a factor of two or three")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_stand_once_and_files_that_exist_are_marked() {
        let dir = tempfile::tempdir().unwrap();
        let (old, new) = (dir.path().join("old"), dir.path().join("new"));
        std::fs::write(&old, "").unwrap();
        let job = Job {
            reads: vec!["survey.toml".into()],
            frames: 3,
            writes: vec![new.clone()],
            may_write: vec![old.clone()],
            memory_bytes: Some(1),
            time_s: Some(200.0),
            ..Job::default()
        };
        let time = "about 3 min on this machine, within a factor of two or three";
        let expected = [
            ("reads", "survey.toml".to_owned()),
            ("", "3 frames".to_owned()),
            ("writes", new.display().to_string()),
            ("", format!("{} (if found, replaced)", old.display())),
            ("memory", "about 1 MiB".to_owned()),
            ("time", time.to_owned()),
        ];
        assert_eq!(job.rows(), expected);
    }
}
