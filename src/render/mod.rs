//! From frames and poses to one metric panorama of the unrolled wall.
//!
//! ```text
//! poses ─ place ──> footprints ─ Canvas::covering ──────────────────> canvas ─┐
//! files ─ Thumbnails ─ Exposure::solve ─> exposure ─ Seams::find ───> seams ──┼─ Scene::draw ──> tiles
//!     └── FrameStack::hold, band by band ───────────────────────────> frames ─┘
//! ```
//!
//! [`stitch()`] does all of it. Every canvas pixel is taken back to its wall point, from there into
//! the frame that shows it best ([`Mode`] has other ways), and the frame's exposure is undone. The
//! same function draws the initial, the refined and the true poses, so pictures differ by their
//! poses only.
//!
//! [`sightings`] goes the other way: from a point of the wall to the frames and pixels that show
//! it.
//!
//! [`cylinder`] is the odd one out: the cylindrical projection of one single photo.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch::progress::Silent;
//! use tunnelstitch::render::{Layout, StitchOptions, stitch};
//! use tunnelstitch::survey::Survey;
//!
//! let survey = Survey::open(Path::new("fixtures/blender_free48"))?;
//! let options = StitchOptions {
//!     px_per_metre: Some(20.0),
//!     ..StitchOptions::default()
//! };
//! let (surface, poses) = (survey.surface.as_ref(), survey.initial_poses());
//! let (camera, frames, shutter) = (&survey.camera, &survey.frames, survey.shutter());
//! let panorama = stitch(surface, camera, frames, &poses, &shutter, &options, &Silent)?;
//! assert!(panorama.coverage() > 0.5);
//! let picture = panorama.into_image(Layout::ThetaRight);
//! assert_eq!(picture.width(), 377);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod band;
mod best_view;
mod budget;
mod canvas;
mod chart;
pub mod cylinder;
mod detail;
mod draw;
mod error;
mod exposure;
mod gaps;
mod glimpses;
mod integer;
mod kernel;
mod labels;
mod levelling;
mod light;
mod locate;
mod maps;
mod memory;
mod panorama;
mod panorama_files;
mod picture;
mod placement;
mod plan;
mod preview;
mod raster_target;
mod row;
mod run;
mod sample;
mod seams;
mod stack;
mod stitch;
mod thumbnails;
mod tiles;
mod view;
mod wall_point;
mod warp;

#[cfg(test)]
mod tests;

pub use band::{Band, Target};
pub use budget::Budget;
pub use canvas::{Canvas, Layout};
pub use draw::{Mode, NO_FRAME};
pub use error::RenderError;
pub use exposure::{Exposure, FrameExposure};
pub use gaps::{Coverage, Gap, gaps_csv};
pub use kernel::{Interpolation, Kernel};
pub use locate::{Sighting, sightings};
pub use maps::Map;
pub use panorama::Panorama;
pub use panorama_files::{CheckpointedFiles, PanoramaFileOptions, PanoramaFiles};
pub use picture::{Picture, PixelFormat};
pub use placement::{Placement, native_px_per_metre, place};
pub use plan::{Plan, RenderOptions, Settled};
pub use preview::Preview;
pub use raster_target::{Kept, RasterLayer, RasterState, RasterTarget};
pub use sample::{Sample, Samples};
pub use seams::Seams;
pub use stack::{FrameStack, level_for};
pub(crate) use stitch::check_memory;
pub use stitch::{LaidOut, Stitch, StitchOptions, lay_out, on_the_axis, render, stitch};
pub(crate) use tiles::{EDGE, Tile, tiles};
pub use wall_point::{FramePixelError, wall_point_of_pixel};
