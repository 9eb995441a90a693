//! Why a raster cannot be written.

use crate::persist::atomic::WriteError;

/// Why a raster cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The file cannot hold pictures of this kind.
    #[error("{0}")]
    Unsupported(&'static str),
    /// A tile that is no part of the picture, came twice or is of the wrong size.
    #[error("tile {column}, {row}: {what}")]
    Tile {
        /// Column in the grid of tiles.
        column: u32,
        /// Row in the grid of tiles.
        row: u32,
        /// What is wrong with it.
        what: &'static str,
    },
    /// The picture was to be finished and is not whole.
    #[error("{missing} of {tiles} tiles of the picture are missing")]
    Incomplete {
        /// Tiles, overviews included, that were not written.
        missing: u64,
        /// Tiles of the picture, overviews included.
        tiles: u64,
    },
    /// What the system said.
    #[error(transparent)]
    Write(#[from] WriteError),
}
