//! Progress reports of long computations.

/// A receiver of progress reports. The library calls it from any thread; the program draws progress
/// bars.
pub trait Progress: Send + Sync {
    /// Begins a stage of `total` equal parts, which replaces the previous one.
    fn start(&self, stage: &str, total: usize);
    /// Reports that `parts` more parts of the stage are done.
    fn advance(&self, parts: usize);
    /// Reports the current state of the stage in a few words.
    fn detail(&self, text: &str);
    /// Ends the stage.
    fn finish(&self);
    /// Reports that a stage of a job begins; all stages that are started until the next call belong
    /// to it. Ignored unless a receiver shows the time that is left of the job.
    fn enter_job_stage(&self, _stage: JobStage) {}
    /// Reports that the job is over.
    fn leave_job(&self) {}
}

/// Place of a stage in a job of several stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobStage {
    /// Number of the stage, from 1.
    pub number: usize,
    /// Number of stages, as far as they are planned.
    pub of: usize,
    /// Share of the job's work that is done before the stage, 0–1.
    pub done_share: f64,
    /// Share of the job's work that the stage takes, 0–1.
    pub share: f64,
}

/// A receiver that ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn start(&self, _stage: &str, _total: usize) {}
    fn advance(&self, _parts: usize) {}
    fn detail(&self, _text: &str) {}
    fn finish(&self) {}
}
