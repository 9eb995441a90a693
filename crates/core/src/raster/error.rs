//! Errors of raster output.

use crate::persist::atomic::WriteError;

/// An error of raster output.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The format does not support pictures of this kind.
    #[error("{0}")]
    Unsupported(&'static str),
    /// A tile outside the picture, a duplicate or one of the wrong size.
    #[error("tile {column}, {row}: {what}")]
    Tile {
        /// Column in the grid of tiles.
        column: u32,
        /// Row in the grid of tiles.
        row: u32,
        /// The problem.
        what: &'static str,
    },
    /// The picture was finished before all tiles arrived.
    #[error("{missing} of {tiles} tiles of the picture are missing")]
    Incomplete {
        /// Tiles, overviews included, that were not written.
        missing: u64,
        /// Tiles of the picture, overviews included.
        tiles: u64,
    },
    /// An error of the operating system.
    #[error(transparent)]
    Write(#[from] WriteError),
}
