//! Files of one panorama, written band by band while it is drawn and resumable from a checkpoint.
//!
//! ```text
//! PanoramaFileOptions ─ begin ─> PanoramaFiles ── CheckpointedFiles (a Target) <── bands
//!                                     │                  └── Checkpoint
//!                                     └─ finish ─> .tif | .png | .jpg, .dzi, maps
//! ```
//!
//! A GeoTIFF and a Deep Zoom picture are written as they are drawn; a PNG or JPEG is held in memory
//! until the end. The maps of coverage, frames, resolution and uncertainty lie in a folder of their
//! own. Bands that another run has drawn are taken over with [`PanoramaFiles::absorb`].

mod begin;
mod files;
mod maps;
mod options;
mod part;
mod state;

pub use files::{CheckpointedFiles, PanoramaFiles};
pub use maps::{DeformationAt, MaskedAt, WallProperties};
pub use options::PanoramaFileOptions;
pub use part::PanoramaPart;
