//! The state of a section: the ends of its tasks in one word.

use crate::jobs::{Job, JobError, NOT_USABLE, Step, Task, TaskState};
use std::path::{Path, PathBuf};

/// The state of a section, as the records of its tasks say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SectionState {
    /// Its poses are refined, and may be used.
    Refined,
    /// It is done with its initial poses, since its plan refines none.
    NotRefined,
    /// The result may not be used.
    NotUsable,
    /// A task failed.
    Failed {
        /// The task and the reason.
        reason: String,
    },
    /// It has not been refined, or not been worked on.
    NotRun,
}

impl SectionState {
    /// Name of the state.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Refined => "refined",
            Self::NotRefined => "not refined",
            Self::NotUsable => "not usable",
            Self::Failed { .. } => "failed",
            Self::NotRun => "not run",
        }
    }
}

/// The tasks of a section with their states.
pub(super) struct SectionTasks<'j> {
    tasks: Vec<(&'j Task, TaskState)>,
}

impl<'j> SectionTasks<'j> {
    /// Reads the states of the tasks of a section of the job in `folder`.
    ///
    /// # Errors
    /// A record that cannot be read.
    pub fn read(folder: &Path, job: &'j Job, section: &str) -> Result<Self, JobError> {
        let tasks = job.tasks.iter();
        let tasks = tasks.filter(|task| task.section == section && task.step != Step::Map);
        let tasks = tasks.map(|task| Ok((task, TaskState::read(folder, task)?)));
        Ok(Self {
            tasks: tasks.collect::<Result<_, JobError>>()?,
        })
    }

    /// The state of the section.
    pub fn state(&self) -> SectionState {
        let failed = self.tasks.iter().find_map(|(task, state)| match state {
            TaskState::Failed { reason } => Some(format!("{}: {reason}", task.id)),
            _ => None,
        });
        if let Some(reason) = failed {
            return SectionState::Failed { reason };
        }
        let exit_code = |state: &TaskState| match state {
            TaskState::Done(record) => Some(record.exit_code),
            _ => None,
        };
        let mut codes = self.tasks.iter().map(|(_, state)| exit_code(state));
        if codes.any(|code| code == Some(NOT_USABLE)) {
            return SectionState::NotUsable;
        }
        // The last task of the step joins the shards.
        let mut steps = self.tasks.iter().rev();
        match steps.find(|(task, _)| task.step == Step::Refine) {
            Some((_, TaskState::Done(_))) => SectionState::Refined,
            None if !self.tasks.is_empty() && self.all_are_done() => SectionState::NotRefined,
            _ => SectionState::NotRun,
        }
    }

    fn all_are_done(&self) -> bool {
        let mut states = self.tasks.iter();
        states.all(|(_, state)| matches!(state, TaskState::Done(_)))
    }

    /// The output of a step, from the folder of the job, if that is done; with a result that may
    /// not be used only on request.
    pub fn output(&self, step: Step, even_if_not_usable: bool) -> Option<PathBuf> {
        let mut tasks = self.tasks.iter().rev();
        let (task, state) = tasks.find(|(task, _)| task.step == step)?;
        match state {
            TaskState::Done(record) if record.exit_code == 0 || even_if_not_usable => {
                task.outputs.first().cloned()
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::{Needs, TaskRecord, TriggerRule};
    use std::fs::{create_dir_all, write};

    fn job() -> Job {
        let task = |id: &str, step: Step| Task {
            id: id.to_owned(),
            section: "a".to_owned(),
            step,
            command: ["tunnelstitch", "x"].map(str::to_owned).to_vec(),
            inputs: Vec::new(),
            outputs: vec![id.into()],
            after: Vec::new(),
            trigger_rule: TriggerRule::AllSuccess,
            needs: Needs {
                cores: 1,
                memory_bytes: 1,
                seconds: 1.0,
                limit_seconds: 1.0,
            },
        };
        Job::new(vec![
            task("a.refine-1", Step::Refine),
            task("a.refine", Step::Refine),
            task("a.stitch", Step::Stitch),
        ])
    }

    /// Records that these tasks ended with these codes; a log for those with none.
    fn end(folder: &Path, ends: &[(&str, Option<u8>)]) {
        for (id, code) in ends {
            let name = folder.join(match code {
                Some(_) => format!("state/{id}.json"),
                None => format!("logs/{id}.log"),
            });
            create_dir_all(name.parent().unwrap()).unwrap();
            let record = code.map(|code| {
                format!(r#"{{"key": "k", "program": "", "exit_code": {code}, "seconds": 1.0}}"#)
            });
            write(name, record.as_deref().unwrap_or("error: no frames\n")).unwrap();
        }
    }

    #[test]
    fn a_section_is_as_its_tasks_ended() {
        let failed = || SectionState::Failed {
            reason: "a.refine-1: no frames".to_owned(),
        };
        for (ends, state, is_stitched) in [
            (&[][..], SectionState::NotRun, false),
            (&[("a.refine-1", Some(0))], SectionState::NotRun, false),
            (&[("a.refine-1", None)], failed(), false),
            (&[("a.refine", Some(4))], SectionState::NotUsable, false),
            (
                &[("a.refine", Some(0)), ("a.stitch", Some(0))],
                SectionState::Refined,
                true,
            ),
        ] {
            let dir = tempfile::tempdir().unwrap();
            end(dir.path(), ends);
            let job = job();
            let tasks = SectionTasks::read(dir.path(), &job, "a").unwrap();
            assert_eq!(tasks.state(), state, "{ends:?}");
            assert_eq!(tasks.output(Step::Stitch, false).is_some(), is_stitched);
        }
        let record = TaskRecord::read(Path::new("none"), &job().tasks[0]);
        assert_eq!(record.unwrap(), None);
    }

    #[test]
    fn a_section_that_is_not_refined_is_done_with_its_initial_poses() {
        let dir = tempfile::tempdir().unwrap();
        let mut job = job();
        job.tasks.retain(|task| task.step == Step::Stitch);
        let state = |job: &Job| SectionTasks::read(dir.path(), job, "a").unwrap().state();
        assert_eq!(state(&job), SectionState::NotRun);
        end(dir.path(), &[("a.stitch", Some(0))]);
        assert_eq!(state(&job), SectionState::NotRefined);
        assert_eq!(state(&Job::new(Vec::new())), SectionState::NotRun);
    }
}
