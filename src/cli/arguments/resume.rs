//! Arguments and checkpoints of runs that can be continued after an interruption.

use crate::cli::output::{Failure, json};
use crate::persist::checkpoint::{Checkpoint, Origin, folder_of};
use crate::persist::provenance::Input;
use crate::survey::Survey;
use serde::Serialize;
use std::path::Path;
use tunnelstitch_core::PROGRAM;

/// Arguments of a run that can be continued.
#[derive(Debug, clap::Args)]
pub struct ResumeArguments {
    /// Start from the beginning, even if an interrupted run could be continued.
    #[arg(long)]
    fresh: bool,
}

/// Describes a run of `options` on `survey`, for the comparison with an interrupted one.
///
/// # Errors
/// Options or a survey that cannot be serialised, which is a bug.
pub fn origin(
    survey: &Survey,
    options: &impl Serialize,
    inputs: Vec<Input>,
) -> Result<Origin, Failure> {
    Ok(Origin {
        program: PROGRAM.to_owned(),
        options: json::text(options)?,
        survey: toml::to_string(&survey.file).map_err(|error| Failure::bug(error.to_string()))?,
        inputs,
    })
}

impl ResumeArguments {
    /// Runs `work` with the checkpoint of `result`. The checkpoint stays only if the run is
    /// interrupted or fails temporarily.
    ///
    /// # Errors
    /// Errors of the checkpoint and of `work`.
    pub fn run<T>(
        &self,
        result: &Path,
        origin: &Origin,
        say: impl FnOnce(&str),
        work: impl FnOnce(&mut Checkpoint) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let mut checkpoint = Checkpoint::open(&folder_of(result), origin, self.fresh)?;
        if checkpoint.is_begun() {
            say("continuing the interrupted run (--fresh starts from the beginning)");
        }
        let done = work(&mut checkpoint);
        match &done {
            Err(failure) if failure.is_temporary() => {}
            // The failure of the run is reported, not that of removing its checkpoint.
            Err(_) => drop(checkpoint.finish()),
            Ok(_) => checkpoint.finish()?,
        }
        done
    }
}
