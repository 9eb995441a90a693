//! Services that stages share: checkpoints, progress and a stopwatch.

use crate::model::problem_error::ProblemError;
use crate::report::StageTime;
use crate::stages::setup::Setup;
use crate::stages::state::{PipelineState, Snapshot};
use crate::stages::work::place_in_job;
use std::sync::Arc;
use std::time::Instant;
use tunnelstitch_core::persist::checkpoint::{Checkpoint, CheckpointError};
use tunnelstitch_core::progress::Progress;

/// Name of the snapshots in a checkpoint.
const NAME: &str = "refine";

/// Services that the stages of one refinement share.
pub struct Session<'a> {
    checkpoint: Option<&'a mut Checkpoint>,
    /// Progress display.
    pub progress: &'a Arc<dyn Progress>,
    /// Stages that are over, with their times.
    pub timings: Vec<StageTime>,
    since: Instant,
    /// Time spent on the stage under way before the last interruption, seconds.
    before_s: f64,
}

impl<'a> Session<'a> {
    /// A session that keeps snapshots in `checkpoint`, if there is one.
    pub fn new(checkpoint: Option<&'a mut Checkpoint>, progress: &'a Arc<dyn Progress>) -> Self {
        Self {
            checkpoint,
            progress,
            timings: Vec::new(),
            since: Instant::now(),
            before_s: 0.0,
        }
    }

    /// The snapshot in the checkpoint, if it has one.
    ///
    /// # Errors
    /// [`ProblemError::Checkpoint`] if it is damaged.
    pub fn snapshot(&self) -> Result<Option<Snapshot>, ProblemError> {
        match &self.checkpoint {
            Some(checkpoint) => Ok(checkpoint.state(NAME)?),
            None => Ok(None),
        }
    }

    /// Resumes light and stopwatch from a snapshot, and returns its state.
    pub fn restore(&mut self, setup: &Setup, snapshot: Snapshot) -> PipelineState {
        setup.frames.set_light(snapshot.light);
        self.timings = snapshot.timings;
        self.before_s = snapshot.elapsed_s;
        snapshot.state
    }

    /// Keeps the state in the checkpoint if it is time; `state` is only asked for then.
    ///
    /// # Errors
    /// [`ProblemError::Checkpoint`] with whatever the system says.
    pub fn keep_if_due(
        &mut self,
        setup: &Setup,
        state: impl FnOnce() -> PipelineState,
    ) -> Result<(), ProblemError> {
        let is_due = |checkpoint: &mut &mut Checkpoint| checkpoint.is_due();
        if self.checkpoint.as_mut().is_some_and(is_due) {
            let snapshot = self.snapshot_of(setup, state());
            if let Some(checkpoint) = &mut self.checkpoint {
                let kept = checkpoint.keep(NAME, &snapshot);
                kept.map_err(CheckpointError::from)?;
            }
        }
        Ok(())
    }

    /// The snapshot of a state.
    pub fn snapshot_of(&self, setup: &Setup, state: PipelineState) -> Snapshot {
        Snapshot {
            state,
            light: setup.frames.light(),
            hidden_bands: setup.hidden_bands.clone(),
            timings: self.timings.clone(),
            elapsed_s: self.elapsed_s(),
        }
    }

    /// Reports the place of the state's first stage in the whole refinement.
    pub fn enter_stage(&self, setup: &Setup, state: &PipelineState) {
        let [width, height] = setup.input.cameras.size().map(f64::from);
        let pixels = width * height;
        let place = place_in_job(&state.over, &state.stages, pixels);
        self.progress.enter_job_stage(place);
    }

    /// Records the time since the last record under the name of a stage.
    pub fn record_time(&mut self, stage: &str) {
        self.timings.push(StageTime {
            stage: stage.to_owned(),
            seconds: self.elapsed_s(),
        });
        (self.since, self.before_s) = (Instant::now(), 0.0);
    }

    /// Time spent on the stage under way, seconds.
    fn elapsed_s(&self) -> f64 {
        self.before_s + self.since.elapsed().as_secs_f64()
    }
}
