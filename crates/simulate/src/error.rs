//! Errors of the simulator.

use crate::bad_frames::BadFramesError;
use std::path::PathBuf;
use tunnelstitch_core::persist::atomic::WriteError;
use tunnelstitch_core::survey::SurveyError;
use tunnelstitch_geometry::files::printed;

/// Reason why a survey cannot be simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// An option has an impossible value.
    #[error("{what}")]
    Option {
        /// The option and its valid range.
        what: String,
    },
    /// The list of bad frames is impossible.
    #[error(transparent)]
    BadFrames(#[from] BadFramesError),
    /// The image of the wall's texture cannot be used.
    #[error("{}: cannot use the texture: {what}", printed(path))]
    Texture {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        what: String,
    },
    /// The shape.json of the lining cannot be used.
    #[error(transparent)]
    ShapeFile(#[from] SurveyError),
    /// A true pose lies outside of the tunnel.
    #[error(
        "frame {frame}: the camera would stand {distance_m:.3} m off the axis, in the wall or \
         beyond it; lower the translation sigmas or the number of frames, or take another seed"
    )]
    CameraOutside {
        /// Index of the frame.
        frame: usize,
        /// Distance from the axis, metres.
        distance_m: f64,
    },
    /// A frame looks along the tunnel and sees an unlimited stretch of wall.
    #[error(
        "frame {frame} would look along the tunnel, farther than {reach_m:.0} m; lower the field \
         of view or the rotation sigma, or take another seed"
    )]
    LooksAlongTheAxis {
        /// Index of the frame.
        frame: usize,
        /// Maximum distance of simulated wall from a camera, metres.
        reach_m: f64,
    },
    /// The output folder is in use.
    #[error("{}: {what}", printed(path))]
    Exists {
        /// The folder.
        path: PathBuf,
        /// Reason why it is not replaced, and the remedy.
        what: &'static str,
    },
    /// An output cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Passes a good value; the error says `what` is wrong with another.
pub(crate) fn check_option(good: bool, what: &str) -> Result<(), SimulateError> {
    if good {
        Ok(())
    } else {
        Err(SimulateError::Option {
            what: what.to_owned(),
        })
    }
}
