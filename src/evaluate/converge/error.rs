//! Why a sweep is impossible.

use crate::evaluate::EvaluateError;
use crate::persist::atomic::WriteError;
use crate::refine::RefineError;
use crate::simulate::SimulateError;
use crate::survey::SurveyError;
use std::path::PathBuf;

/// Why a sweep is impossible. A survey that the refinement refuses is no such error but a result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvergeError {
    /// An option is impossible.
    #[error("{what}")]
    Option {
        /// Which, and what it should be.
        what: String,
    },
    /// The log of an earlier sweep cannot be continued.
    #[error("{}: {what}", path.display())]
    Log {
        /// The log.
        path: PathBuf,
        /// What is wrong, and the remedy.
        what: String,
    },
    /// A survey cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A simulated survey cannot be read.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A survey whose efficiency is asked for cannot be refined, or bounded.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// Poses cannot be judged.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// An output cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
