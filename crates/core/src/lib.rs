//! Frames, surveys and large rasters, and how files are written and runs are resumed.
//!
//! The crate `tunnelstitch` re-exports what users of the library need, and its documentation has
//! the flow of data, the order of the folders and the symbols.

/// Name and version, as results carry them.
pub const PROGRAM: &str = concat!("tunnelstitch ", env!("CARGO_PKG_VERSION"));

pub mod bitmap_text;
pub mod colour_map;
pub mod frames;
pub mod persist;
pub mod points;
pub mod progress;
pub mod raster;
pub mod storage;
pub mod survey;
#[doc(hidden)]
pub mod test_wall;
