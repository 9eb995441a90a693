//! Why a tunnel cannot be exported or shown.

use crate::persist::atomic::WriteError;
use crate::raster::RasterError;
use crate::render::RenderError;
use std::path::PathBuf;

/// Why a tunnel cannot be exported or shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InspectError {
    /// Too much wall for one file.
    #[error(
        "{}: the pictures alone have {} MiB, and one file is to have no more than {} MiB; use --3dtiles, which streams, or lower --px-per-metre",
        path.display(), bytes >> 20, limit_bytes >> 20
    )]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Bytes of its pictures.
        bytes: u64,
        /// The most that one file is to have.
        limit_bytes: u64,
    },
    /// A file of marks that is none, or a mark that cannot be kept.
    #[error("{}: {what}; mend the file or move it away", path.display())]
    Marks {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The folder to be shown cannot be read.
    #[error("{}: {what}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The server cannot listen.
    #[error(
        "cannot listen on 127.0.0.1:{port}: {what}; choose another --port, or 0 for any that is free"
    )]
    Listen {
        /// The port.
        port: u16,
        /// What the system said.
        what: String,
    },
    /// The program was built without the page.
    #[error(
        "this program was built without its viewer, since npm was missing: install Node.js 20 or newer with npm and build it again"
    )]
    NoViewer,
    /// What the raster or the system said.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// What the system said.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The panorama of the textures cannot be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A file of the page has no JSON, which is a bug.
    #[error("cannot make JSON of {name}: {source}")]
    Json {
        /// Name of the file.
        name: &'static str,
        /// Error of the encoder.
        source: serde_json::Error,
    },
}
