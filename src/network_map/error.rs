//! Errors of the map.

use crate::files::printed;
use crate::inspect::InspectError;
use crate::jobs::JobError;
use std::path::PathBuf;

/// Reason why a network has no map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// The network has no coordinate reference system.
    #[error(
        "{}: has no crs, so the places of its sections are not known; write crs = \"EPSG:2056\" \
         (the code of yours) and its [[manhole]] tables",
        printed(path)
    )]
    NoCrs {
        /// Its file.
        path: PathBuf,
    },
    /// A result cannot be read.
    #[error("{}: {what}; refine the survey again with this version", printed(path))]
    Result {
        /// The file.
        path: PathBuf,
        /// The error of the system or the parser.
        what: String,
    },
    /// The network, the job, or a line.
    #[error(transparent)]
    Job(#[from] JobError),
    /// Marks.
    #[error(transparent)]
    Marks(#[from] InspectError),
    /// The database, which is in memory.
    #[error("cannot write the map: {0}")]
    Database(#[from] rusqlite::Error),
}
