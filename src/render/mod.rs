//! From frames and poses to one metric panorama of the unrolled wall.
//!
//! ```text
//! poses ─ place ──> footprints ─ Canvas::covering ──> canvas
//! files ─ FrameStack::load ──────────────────────────> render ──> Panorama
//! ```
//!
//! [`stitch()`] does all of it. Every canvas pixel is taken back to its wall point, from there into each frame
//! that sees it, and the samples are averaged with weights that fall to zero at the frame's border. The
//! same function draws the initial, the refined and the true poses, so pictures differ by their poses only.
//!
//! [`sightings`] goes the other way: from a point of the wall to the frames and pixels that show it.
//!
//! [`cylinder`] is the odd one out: the cylindrical projection of one single photo.

mod blend;
mod canvas;
pub mod cylinder;
mod error;
mod locate;
mod memory;
mod panorama;
mod picture;
mod placement;
mod stack;
mod stitch;
pub mod super_resolve;
mod tiles;

pub use blend::render;
pub use canvas::{Canvas, Layout};
pub use error::RenderError;
pub use locate::{Sighting, sightings};
pub use panorama::Panorama;
pub use picture::{Interpolation, Picture};
pub use placement::{Placement, native_px_per_metre, place};
pub use stack::{FrameStack, level_for};
pub(crate) use stitch::check_memory;
pub use stitch::{LaidOut, StitchOptions, lay_out, on_the_axis, stitch};
pub(crate) use tiles::{Tile, tiles};
