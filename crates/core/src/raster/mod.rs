//! Tiled output of pictures larger than the memory.
//!
//! ```text
//!                      ┌─ OverviewBuilder ─────┐
//! RasterTile batches ──┤  2 × 2 downsampling   ├──> CogWriter ──> NAME.tif
//!  in any order        └─ tiles of all levels ─┘    DziWriter ──> NAME.dzi, NAME_files/
//! ```
//!
//! A [`RasterSpec`] describes the pixels and their *no-data* value; the picture then arrives as
//! squares of [`TILE_EDGE_PX`] pixels, each exactly once. A batch is reduced and compressed on all
//! threads of the current rayon pool. The files do not depend on the order of the tiles, the
//! batches, or the number of threads, to the byte.
//!
//! The memory holds the batch and the incomplete overview tiles: [`RasterSpec::pending_bytes`].
//! Tiles that arrive along the shorter side of the picture keep their number small.
//!
//! # Example
//!
//! ```
//! use tunnelstitch_core::persist::atomic::OutputSet;
//! use tunnelstitch_core::raster::{
//!     CogWriter, Compression, TILE_EDGE_PX, RasterSpec, RasterTile, Reduce, SampleType,
//! };
//!
//! let folder = tempfile::tempdir()?;
//! let spec = RasterSpec {
//!     width: 700,
//!     height: 300,
//!     samples: SampleType::U8,
//!     channels: 1,
//!     alpha: false,
//!     nodata: None,
//!     reduce: Reduce::Mean,
//!     georeference: None,
//!     quantity: None,
//! };
//! let path = folder.path().join("wall.tif");
//! let mut writer = CogWriter::begin(&path, spec, Compression::Deflate)?;
//! for column in 0..2 {
//!     let pixels = vec![128; TILE_EDGE_PX * TILE_EDGE_PX];
//!     writer.add(vec![RasterTile { column, row: 0, pixels }])?;
//! }
//! let mut outputs = OutputSet::default();
//! writer.finish(&mut outputs)?;
//! outputs.commit()?;
//! assert_eq!(image::image_dimensions(&path)?, (700, 300));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cog;
mod compression;
mod deflate;
mod directory;
mod downsample;
mod dzi;
mod error;
mod geo_tags;
mod jpeg;
mod overviews;
mod spec;
mod spool;
#[cfg(test)]
mod test_picture;

pub use cog::{CogState, CogWriter};
pub use compression::Compression;
pub use dzi::{DziFormat, DziState, DziWriter, files_folder};
pub use error::RasterError;
pub use jpeg::compress as compress_jpeg;
pub use overviews::{LevelTile, OverviewBuilder};
pub use spec::{
    Georeference, Nodata, Quantity, RasterSpec, RasterTile, Reduce, SampleType, TILE_EDGE_PX,
    TileOrder,
};
