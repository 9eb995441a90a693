//! Jobs: a network of surveys as a graph of tasks, each a call of the program that reads and writes
//! files, so that any engine that starts programs can run it on many machines (docs/jobs.md).
//!
//! ```text
//! network.toml ─> Network ─> plan ─> Job (job.json) ─┬─> run_job: every task that is ready,
//!                                                    │      as processors and memory allow
//!                                                    └─> run_task: key, record, process
//! ```
//!
//! | subject | file |
//! | --- | --- |
//! | sections, their surveys, and where they lie on the map | `network`: [`Network`] |
//! | the graph and its file | [`Job`] |
//! | its folder, on this machine or on storage | [`JobFolder`] |
//! | its tasks | [`plan()`] |
//! | their calls, needs and expectations | `section_calls`, `section_work`, `panorama_work` |
//! | hash by which a task is done or not | `task_key` |
//! | record of a task that is done | [`TaskRecord`] |
//! | how the last attempt of a task ended | [`TaskState`] |
//! | one task | [`run_task()`] |
//! | a process with a limit of time | `process` |
//! | all tasks on this machine | [`run_job()`] |

mod error;
mod job;
mod job_folder;
mod network;
mod panorama_work;
mod plan;
mod process;
mod run_job;
mod run_task;
mod schedule;
mod section_calls;
mod section_work;
mod task_key;
mod task_record;
mod task_state;
mod text_file;

pub use error::JobError;
pub use job::{JOB_FILE, Job, Needs, SectionStep, Step, Task, TriggerRule};
pub use job_folder::JobFolder;
pub use network::{Crs, Manhole, Network, Section, SectionEnds, SectionLine};
pub use plan::{Division, MAP_FILE, PlanOptions, plan};
pub use process::end_processes;
pub use run_job::{JobSummary, TaskEnd, TaskOutcome, run_job};
pub use run_task::{DoneTask, NOT_USABLE, read_records, run_task};
pub use schedule::Machine;
pub use task_record::TaskRecord;
pub use task_state::TaskState;
