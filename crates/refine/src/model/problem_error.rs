//! Errors of the photometric problem and its solver.

use crate::linear::factor_error::FactorError;
use tunnelstitch_core::frames::FrameError;
use tunnelstitch_core::persist::checkpoint::CheckpointError;
use tunnelstitch_geometry::surface::SurfaceError;

/// Failures of setting up or solving a photometric problem.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// A frame cannot be read.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A frame's pose is outside the tunnel, or its camera does not see the wall.
    #[error("frame {frame}, by its pose, the tunnel and the calibration: {source}")]
    Placement {
        /// The frame.
        frame: usize,
        /// Cause.
        source: SurfaceError,
    },
    /// The normal equations have no solution.
    #[error(
        "frames {first} to {last}: {source}; the equations of their pixels and of [prior] have no \
         solution"
    )]
    Factor {
        /// First estimated frame.
        first: usize,
        /// Last estimated frame.
        last: usize,
        /// Cause.
        source: FactorError,
    },
    /// The iteration stopped with an error.
    #[error("the solver stopped: {0}")]
    Solver(String),
    /// The checkpoint cannot be written, or not be resumed.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}
