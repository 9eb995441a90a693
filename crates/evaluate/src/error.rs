//! Errors of an evaluation.

use tunnelstitch_geometry::surface::SurfaceError;
use tunnelstitch_render::RenderError;

/// Reason why an evaluation is impossible.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// Two trajectories cannot be compared frame by frame.
    #[error("{estimated} poses are to be compared with {others}; each needs one pose per frame")]
    Count {
        /// Number of evaluated poses.
        estimated: usize,
        /// Number of reference poses, or of frames.
        others: usize,
    },
    /// There are no poses.
    #[error("no poses to evaluate")]
    Empty,
    /// A ray of a frame meets no wall.
    #[error("frame {frame}, {which} pose: {source}; correct the pose, or remove the frame")]
    Frame {
        /// Index of the frame.
        frame: usize,
        /// "estimated" or "true".
        which: &'static str,
        /// Underlying error.
        source: SurfaceError,
    },
    /// Two panoramas lie on different canvases.
    #[error(
        "the panoramas are {}×{} and {}×{} px; only equal canvases can be compared",
        first[0], first[1], second[0], second[1]
    )]
    Canvas {
        /// Columns and rows of the first.
        first: [usize; 2],
        /// Columns and rows of the second.
        second: [usize; 2],
    },
    /// A panorama cannot be drawn.
    #[error("{which} poses: {source}")]
    Render {
        /// "initial", "refined" or "true".
        which: &'static str,
        /// Underlying error.
        source: RenderError,
    },
}

/// Checks that `estimated` poses can be paired with `others`.
///
/// # Errors
/// [`EvaluateError::Count`], [`EvaluateError::Empty`].
pub(super) fn check_pairs(estimated: usize, others: usize) -> Result<(), EvaluateError> {
    if estimated != others {
        return Err(EvaluateError::Count { estimated, others });
    }
    if estimated == 0 {
        return Err(EvaluateError::Empty);
    }
    Ok(())
}
