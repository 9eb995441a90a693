//! Reasons why a photometric problem cannot be set up or solved.

use crate::frames::FrameError;
use crate::persist::checkpoint::CheckpointError;
use crate::refine::linear::sparse_cholesky::FactorError;
use crate::surface::SurfaceError;

/// Why a problem cannot be set up or solved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// A frame cannot be read any more.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A frame's pose does not go with the tunnel.
    #[error("frame {frame}: {source}; check the initial poses, radius_m and the calibration")]
    Placement {
        /// The frame.
        frame: usize,
        /// What is wrong.
        source: SurfaceError,
    },
    /// The normal equations have no solution.
    #[error(
        "frames {first} to {last}: {source}; check that the poses are camera-to-world, radius_m, the calibration, and that [prior] is neither absurdly wide nor narrow"
    )]
    Factor {
        /// First estimated frame.
        first: usize,
        /// Last estimated frame.
        last: usize,
        /// What is wrong.
        source: FactorError,
    },
    /// The iteration broke off for a reason of its own.
    #[error("the solver stopped: {0}")]
    Solver(String),
    /// What is done cannot be kept, or not be continued.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}
