//! From frames and poses to one metric panorama of the unrolled wall.
//!
//! ```text
//! poses ─ place ──> footprints ─ Canvas::covering ──────────────────> canvas ─┐
//! files ─ Thumbnails ─ Exposure::solve ─> exposure ─ Seams::find ──> seams ───┼─> bands
//!     └── PictureCache::load, band by band ─────────────────────────> frames ─┘
//! ```
//!
//! [`stitch()`] does all of it. Every canvas pixel is mapped to its wall point, from there into the
//! frame that shows it best ([`Mode`] has other ways), and the frame's exposure is undone. Initial,
//! refined and true poses are drawn by the same function, so pictures differ by their poses only.
//!
//! [`sightings`] is the opposite direction: from a point of the wall to the frames and pixels that
//! show it. [`cylinder`] stands alone: the cylindrical projection of one single photo.
//!
//! Each folder builds on those above it:
//!
//! | subject | folder |
//! | --- | --- |
//! | pixels of the panorama on the wall, and the frames that see them | [`layout`] |
//! | mapping of a tile's pixels into a frame | [`warp`] |
//! | pictures, values between pixels, exposure | [`sampling`] |
//! | seams, blending, super-resolution: tiles' pixels from several frames | [`compositing`] |
//! | panoramas, files, previews, maps, and the memory they need | [`output`] |
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch_core::progress::Silent;
//! use tunnelstitch_render::{Layout, StitchOptions, stitch};
//! use tunnelstitch_core::survey::Survey;
//!
//! let survey = Survey::open(Path::new("../../fixtures/blender_free48"))?;
//! let options = StitchOptions {
//!     px_per_metre: Some(20.0),
//!     ..StitchOptions::default()
//! };
//! let (surface, poses) = (survey.surface.as_ref(), survey.initial_poses());
//! let (cameras, frames, shutter) = (&survey.cameras, &survey.frames, survey.shutter());
//! let panorama = stitch(surface, cameras, frames, &poses, &shutter, &options, &Silent)?;
//! assert!(panorama.coverage() > 0.5);
//! let picture = panorama.into_image(Layout::ThetaRight);
//! assert_eq!(picture.width(), 377);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod compositing;
mod error;
mod layout;
mod output;
mod sampling;
mod warp;

#[cfg(test)]
mod tests;

pub use compositing::band::{Band, Target};
pub use compositing::options::{Mode, RenderOptions};
pub use compositing::seams::Seams;
pub use error::RenderError;
pub use layout::canvas::{Canvas, Layout};
pub use layout::placement::{NO_FRAME, Placement, native_px_per_metre, place_frames};
pub use layout::sightings::{Sighting, sightings};
pub use layout::tiles::{EDGE, Tile, tiles};
pub use layout::wall_point::{FramePixelError, hit_of_pixel};
pub use output::budget::Budget;
pub use output::cylinder;
pub use output::gaps::{Coverage, Gap, gaps_csv};
pub use output::live_wall::LiveWall;
pub use output::maps::Map;
pub use output::memory::available_bytes;
pub use output::panorama::Panorama;
pub use output::panorama_files::{
    CheckpointedFiles, DeformationAt, MaskedAt, PanoramaFileOptions, PanoramaFiles, PanoramaPart,
    WallProperties,
};
pub use output::panorama_progress::{PanoramaJob, PanoramaProgress};
pub use output::plan::{Plan, Settled};
pub use output::preview::Preview;
pub use output::raster_target::{Kept, RasterLayer, RasterState, RasterTarget};
pub use output::stitch::check_memory;
pub use output::stitch::{
    LaidOut, PlannedMemory, Stitch, StitchOptions, lay_out, on_the_axis, render, stitch,
};
pub use sampling::exposure::{Exposure, FrameExposure};
pub use sampling::picture::Picture;
pub use sampling::picture_cache::{PictureCache, level_for};
pub use sampling::pixel_format::PixelFormat;
pub use sampling::sample::{Sample, Samples};
pub use tunnelstitch_geometry::numerics::kernel::{Interpolation, Kernel};
