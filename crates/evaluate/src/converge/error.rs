//! Errors of a convergence test.

use crate::error::EvaluateError;
use std::path::PathBuf;
use tunnelstitch_core::persist::atomic::WriteError;
use tunnelstitch_core::survey::SurveyError;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_refine::RefineError;
use tunnelstitch_simulate::SimulateError;

/// Reason why a sweep is impossible.
///
/// A survey that the refinement refuses is a result, not an error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvergeError {
    /// An option has an impossible value.
    #[error("{what}")]
    Option {
        /// The option and its valid range.
        what: String,
    },
    /// The log of an earlier sweep cannot be continued.
    #[error("{}: {what}", printed(path))]
    Log {
        /// Path of the log.
        path: PathBuf,
        /// Description of the problem, and the remedy.
        what: String,
    },
    /// A survey cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A simulated survey cannot be read.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A survey of the efficiency test cannot be refined, or its bound cannot be computed.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// Poses cannot be evaluated.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// An output cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
