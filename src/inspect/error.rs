//! Errors of export and inspection.

use crate::files::printed;
use crate::inspect::mark::MarkVersions;
use crate::persist::atomic::WriteError;
use crate::persist::part_file::PartError;
use crate::raster::RasterError;
use crate::render::RenderError;
use crate::survey::SurveyError;
use std::path::PathBuf;

/// Reason why a tunnel cannot be exported or shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InspectError {
    /// The wall is too long for one file.
    #[error(
        "{}: the pictures alone have {} MiB, and one file is to have no more than {} MiB; \
         use --3dtiles, which streams, or lower --px-per-metre",
        printed(path), bytes >> 20, limit_bytes >> 20
    )]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Size of its textures, bytes.
        bytes: u64,
        /// Maximum size of one file, bytes.
        limit_bytes: u64,
    },
    /// A file of marks is invalid, or a mark cannot be saved.
    #[error("{}: {what}; mend the file or move it away", printed(path))]
    Marks {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        what: String,
    },
    /// Somebody else has changed the same mark.
    #[error("the mark has been changed in the file meanwhile; load the page again")]
    MarkConflict {
        /// Both versions.
        versions: Box<MarkVersions>,
    },
    /// The folder to be shown cannot be read.
    #[error("{}: {what}", printed(path))]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Description of the problem.
        what: String,
    },
    /// The server cannot listen.
    #[error(
        "cannot listen on 127.0.0.1:{port}: {what}; \
         choose another --port, or 0 for any that is free"
    )]
    Listen {
        /// The port.
        port: u16,
        /// Error message of the system.
        what: String,
    },
    /// The program was built without the page.
    #[error(
        "this program was built without its viewer, since npm was missing: \
         install Node.js 20 or newer with npm and build it again"
    )]
    NoViewer,
    /// The raster cannot be encoded or written.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// An output cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A part that another run has drawn cannot be taken over.
    #[error(transparent)]
    Part(#[from] PartError),
    /// The panorama of the textures cannot be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The shape of the wall cannot be read.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A file of the page has no JSON, which is a bug.
    #[error("cannot make JSON of {name}: {source}")]
    Json {
        /// Name of the file.
        name: &'static str,
        /// Error of the encoder.
        source: serde_json::Error,
    },
}
