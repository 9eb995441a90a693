//! Runs that go on after an interruption.

use super::Failure;
use crate::PROGRAM;
use crate::persist::checkpoint::{Checkpoint, Origin, folder_of};
use crate::persist::provenance::Input;
use crate::survey::Survey;
use serde::Serialize;
use std::path::Path;

/// Whether to go on.
#[derive(Debug, clap::Args)]
pub struct ResumeArguments {
    /// Begin anew, even if an interrupted run is there that could go on.
    #[arg(long)]
    fresh: bool,
}

/// What a run of `options` on `survey` is made of.
///
/// # Errors
/// None but a bug.
pub fn origin(
    survey: &Survey,
    options: &impl Serialize,
    inputs: Vec<Input>,
) -> Result<Origin, Failure> {
    Ok(Origin {
        program: PROGRAM.to_owned(),
        options: super::json::text(options)?,
        survey: toml::to_string(&survey.file).map_err(|error| Failure::bug(error.to_string()))?,
        inputs,
    })
}

impl ResumeArguments {
    /// Does `work` with the checkpoint of `result`, which stays only if the run is interrupted or
    /// meets a passing obstacle.
    ///
    /// # Errors
    /// Those of the checkpoint and of `work`.
    pub fn run<T>(
        &self,
        result: &Path,
        origin: &Origin,
        say: impl FnOnce(&str),
        work: impl FnOnce(&mut Checkpoint) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let mut checkpoint = Checkpoint::open(&folder_of(result), origin, self.fresh)?;
        if checkpoint.is_begun() {
            say("going on with the run that was interrupted (--fresh begins anew)");
        }
        let done = work(&mut checkpoint);
        match &done {
            Err(failure) if failure.is_passing() => {}
            // The failure is what matters.
            Err(_) => drop(checkpoint.finish()),
            Ok(_) => checkpoint.finish()?,
        }
        done
    }
}
