//! `job.json`: the graph of tasks.

use super::error::JobError;
use super::text_file;
use crate::files::{printed, read_text};
use crate::persist::atomic::WriteError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// Name of the file in the folder of a job.
pub const JOB_FILE: &str = "job.json";
/// Value of `format`.
const FORMAT: &str = "tunnelstitch job";
/// Value of `version`.
const VERSION: u32 = 1;
/// Largest size of the file, bytes: a million tasks.
const MAX_BYTES: u64 = 1 << 30;

/// A graph of tasks (docs/jobs.md). Paths are relative to its folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Job {
    format: String,
    version: u32,
    /// Name and version of the program that planned it.
    pub program: String,
    /// The tasks, each behind those that it comes after.
    pub tasks: Vec<Task>,
}

/// A call of the program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// `SECTION.STEP`; unique.
    pub id: String,
    /// The section that it belongs to.
    pub section: String,
    /// The step that it is.
    pub step: Step,
    /// The call, in which the first word stands for the program.
    pub command: Vec<String>,
    /// Files, and folders of which every file counts, that are there before the job begins.
    pub inputs: Vec<PathBuf>,
    /// Files and folders that it writes.
    pub outputs: Vec<PathBuf>,
    /// Tasks whose outputs it reads.
    pub after: Vec<String>,
    /// The ends of those tasks after which it runs.
    #[serde(default, skip_serializing_if = "TriggerRule::is_default")]
    pub trigger_rule: TriggerRule,
    /// Its needs and expectations.
    pub needs: Needs,
}

/// The ends of the tasks before a task after which it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TriggerRule {
    /// All of them are done, with results that may be used.
    #[default]
    AllSuccess,
    /// All of them have ended: it reports on them, whether they are done, have failed or were
    /// skipped, and what it reads may be missing.
    AllDone,
}

impl TriggerRule {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// Needs and expectations of a task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Needs {
    /// Processors.
    pub cores: u16,
    /// Memory, bytes.
    pub memory_bytes: u64,
    /// Expected time on that many processors, seconds.
    pub seconds: f64,
    /// Time after which it is ended, seconds.
    pub limit_seconds: f64,
}

/// A step of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum SectionStep {
    /// Its poses are refined.
    Refine,
    /// Its wall is unrolled into a panorama.
    Stitch,
    /// Its report is written.
    Report,
    /// Its wall is written as 3D Tiles.
    Export,
}

/// A step of a section, or of the whole network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Step {
    /// [`SectionStep::Refine`].
    Refine,
    /// [`SectionStep::Stitch`].
    Stitch,
    /// [`SectionStep::Report`].
    Report,
    /// [`SectionStep::Export`].
    Export,
    /// The map of all sections is written.
    Map,
}

impl From<SectionStep> for Step {
    fn from(step: SectionStep) -> Self {
        match step {
            SectionStep::Refine => Self::Refine,
            SectionStep::Stitch => Self::Stitch,
            SectionStep::Report => Self::Report,
            SectionStep::Export => Self::Export,
        }
    }
}

impl fmt::Display for Step {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Refine => "refine",
            Self::Stitch => "stitch",
            Self::Report => "report",
            Self::Export => "export",
            Self::Map => "map",
        })
    }
}

impl Job {
    /// The job of these tasks, planned by this program.
    pub fn new(tasks: Vec<Task>) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            program: tunnelstitch_core::PROGRAM.to_owned(),
            tasks,
        }
    }

    /// Reads the job of a folder.
    ///
    /// # Errors
    /// A file that is missing, malformed, or of another version; tasks that stand twice, come after
    /// tasks that do not stand before them, or would write outside of the folder.
    pub fn read(folder: &Path) -> Result<Self, JobError> {
        let path = folder.join(JOB_FILE);
        let text = read_text(&path, MAX_BYTES).map_err(|source| JobError::Read {
            path: path.clone(),
            source,
            remedy: "; a job is a folder that tunnelstitch plan-job has written",
        })?;
        let job: Self =
            serde_json::from_str(&text).map_err(|error| text_file::json_error(&path, &error))?;
        job.validate()
            .map_err(|what| JobError::Value { path, what })?;
        Ok(job)
    }

    /// Writes the job into a folder, which is created if it is missing.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        text_file::write_json(&folder.join(JOB_FILE), self)
    }

    /// The task of this identifier.
    ///
    /// # Errors
    /// There is none; the tasks of the same section are named.
    pub fn task(&self, folder: &Path, id: &str) -> Result<&Task, JobError> {
        let found = self.tasks.iter().find(|task| task.id == id);
        found.ok_or_else(|| {
            let section = id.rsplit_once('.').map_or(id, |(section, _)| section);
            let same = self.tasks.iter().filter(|task| task.section == section);
            let names: Vec<&str> = same.map(|task| task.id.as_str()).collect();
            JobError::NoSuchTask {
                path: folder.join(JOB_FILE),
                task: id.to_owned(),
                nearest: match names.is_empty() {
                    true => String::new(),
                    false => format!("; there are {}", names.join(", ")),
                },
            }
        })
    }

    /// The places of the tasks by their identifiers.
    pub fn places(&self) -> BTreeMap<&str, usize> {
        let tasks = self.tasks.iter().enumerate();
        tasks.map(|(k, task)| (task.id.as_str(), k)).collect()
    }

    fn validate(&self) -> Result<(), String> {
        if self.format != FORMAT || self.version != VERSION {
            return Err(format!(
                "is {:?} of version {}, and this program reads {FORMAT:?} of version {VERSION}; \
                 plan the job anew",
                self.format, self.version
            ));
        }
        let places = self.places();
        for (k, task) in self.tasks.iter().enumerate() {
            task.validate()?;
            if places[task.id.as_str()] != k {
                return Err(format!("task {} stands twice", task.id));
            }
            for after in &task.after {
                if places.get(after.as_str()).is_none_or(|place| *place >= k) {
                    return Err(format!(
                        "task {} comes after {after}, which does not stand before it",
                        task.id
                    ));
                }
            }
        }
        Ok(())
    }
}

impl Task {
    /// True if it ends the refinement of its section: not for one shard of it.
    pub fn ends_refinement(&self) -> bool {
        self.step == Step::Refine && self.id == format!("{}.{}", self.section, self.step)
    }

    fn validate(&self) -> Result<(), String> {
        let is_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
        let id = &self.id;
        if id.is_empty() || id.starts_with('.') || !id.bytes().all(is_name) {
            return Err(format!(
                "task id is {id:?}; it must be letters, digits, -, _ and dots, since it names files"
            ));
        }
        if self.command.len() < 2 {
            return Err(format!("task {id} has no command"));
        }
        let is_below = |path: &&PathBuf| {
            let mut parts = path.components();
            !path.as_os_str().is_empty() && parts.all(|part| matches!(part, Component::Normal(_)))
        };
        if let Some(path) = self.outputs.iter().find(|path| !is_below(path)) {
            return Err(format!(
                "task {id} writes {}, which is not below the folder of the job",
                printed(path)
            ));
        }
        let Needs {
            seconds,
            limit_seconds,
            ..
        } = self.needs;
        let is_time = |seconds: f64| seconds > 0.0 && seconds.is_finite();
        if !is_time(seconds) || !is_time(limit_seconds) {
            return Err(format!(
                "task {id} needs {seconds} of at most {limit_seconds} s; both must be positive"
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A task of the section `a`.
    pub fn task(id: &str, after: &[&str]) -> Task {
        Task {
            id: id.to_owned(),
            section: "a".to_owned(),
            step: Step::Refine,
            command: vec!["tunnelstitch".to_owned(), "refine".to_owned()],
            inputs: vec!["../in.txt".into()],
            outputs: vec![format!("a/{id}").into()],
            after: after.iter().map(|id| (*id).to_owned()).collect(),
            trigger_rule: TriggerRule::AllSuccess,
            needs: Needs {
                cores: 2,
                memory_bytes: 1 << 30,
                seconds: 12.5,
                limit_seconds: 600.0,
            },
        }
    }

    #[test]
    fn a_job_is_read_as_written() {
        let dir = tempfile::tempdir().unwrap();
        let job = Job::new(vec![task("a.refine", &[]), task("a.stitch", &["a.refine"])]);
        job.write(dir.path()).unwrap();
        assert_eq!(Job::read(dir.path()).unwrap(), job);
        assert_eq!(
            job.task(dir.path(), "a.stitch").unwrap().after,
            ["a.refine"]
        );
        let message = job.task(dir.path(), "a.report").unwrap_err().to_string();
        assert!(
            message.ends_with("there are a.refine, a.stitch"),
            "{message}"
        );
    }

    #[test]
    fn what_is_no_graph_is_refused() {
        let wrong = |change: fn(&mut Job)| {
            let mut job = Job::new(vec![task("a.refine", &[]), task("a.stitch", &["a.refine"])]);
            change(&mut job);
            job.validate().unwrap_err()
        };
        for (message, expected) in [
            (wrong(|job| job.version = 2), "plan the job anew"),
            (
                wrong(|job| job.tasks.swap(0, 1)),
                "does not stand before it",
            ),
            (
                wrong(|job| job.tasks[0].after = vec!["a.refine".to_owned()]),
                "does not stand before it",
            ),
            (
                wrong(|job| job.tasks[1] = task("a.refine", &[])),
                "stands twice",
            ),
            (wrong(|job| job.tasks[0].id = "../x".to_owned()), "task id"),
            (wrong(|job| job.tasks[0].command.clear()), "no command"),
            (
                wrong(|job| job.tasks[0].outputs = vec!["../x".into()]),
                "not below the folder",
            ),
            (
                wrong(|job| job.tasks[0].needs.seconds = f64::NAN),
                "must be positive",
            ),
        ] {
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn unknown_keys_are_refused_with_their_place() {
        let dir = tempfile::tempdir().unwrap();
        let job = Job::new(vec![task("a.refine", &[])]);
        job.write(dir.path()).unwrap();
        let path = dir.path().join(JOB_FILE);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("\"cores\"", "\"core\"")).unwrap();
        let message = Job::read(dir.path()).unwrap_err().to_string();
        assert!(message.contains("unknown field `core`"), "{message}");
        assert!(message.contains("job.json:"), "{message}");
    }
}
