//! Why a survey cannot be simulated.

use super::BadFramesError;
use crate::persist::atomic::WriteError;
use std::path::PathBuf;

/// Why a survey cannot be simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// An option is impossible.
    #[error("{what}")]
    Option {
        /// Which, and what it should be.
        what: String,
    },
    /// A bad frame is impossible.
    #[error(transparent)]
    BadFrames(#[from] BadFramesError),
    /// The wall's picture cannot be used.
    #[error("{}: cannot use the texture: {what}", path.display())]
    Texture {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// A true pose left the tunnel.
    #[error(
        "frame {frame}: the camera would stand {distance_m:.3} m off the axis, in the wall or beyond it; lower the translation sigmas or the number of frames, or take another seed"
    )]
    CameraOutside {
        /// Index of the frame.
        frame: usize,
        /// Distance from the axis, metres.
        distance_m: f64,
    },
    /// A frame sees wall without end.
    #[error(
        "frame {frame} would look along the tunnel, farther than {reach_m:.0} m; lower the field of view or the rotation sigma, or take another seed"
    )]
    LooksAlongTheAxis {
        /// Index of the frame.
        frame: usize,
        /// How far the simulated wall reaches from a camera, metres.
        reach_m: f64,
    },
    /// The output folder is in use.
    #[error("{}: {what}", path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
        /// Why it is not replaced, and the remedy.
        what: &'static str,
    },
    /// An output cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
