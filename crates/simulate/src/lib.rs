//! Simulated surveys: known walls, known poses, known noise.
//!
//! ```text
//! SimulateOptions ─ Scene ─> plan, true poses, wall ─ WallRaster ─ cast_rays ─> frames
//! ```
//!
//! Every degradation is off by default, has a file of its own, and is applied in this order:
//!
//! ```text
//! wall ─ wet patches ─ cables, lamps ─ moving objects ─ vignetting ─ shaft of the rig ─┐
//!               ┌───────────────────────────────────────────────────────────────────────┘
//!               └─ exposure ─┬─> Scene::render_exact
//!                            └─ fault injection ─ sensor noise and rounding ─> frames
//! ```
//!
//! Each pixel is the mean of points spread over its square, interpolated between rays that are
//! intersected with the wall by the simulator's own equations. It shares no warp code with the
//! renderer or the estimator, so that it can judge them.
//!
//! [`SimulateOptions::centred`], [`SimulateOptions::off_centre`] and [`SimulateOptions::free`] are
//! the three experiments of the paper (arXiv 1806.10278). [`write_survey`] writes a whole survey
//! folder; [`Scene`] renders single frames in memory.

mod as_built;
mod bad_frames;
mod camera_path;
mod cross_section;
mod error;
mod exposure;
mod false_position;
mod fault_injection;
mod fittings;
mod lining;
mod moving_objects;
mod options;
mod procedural_noise;
mod ray_casting;
mod rendering;
mod rig_shaft;
mod scene;
mod sensor;
mod survey_folder;
mod texture;
mod tunnel;
mod vignetting;
mod visible_wall;
mod wall_intersection;
mod wall_raster;
mod wet_patches;

pub use as_built::{AsBuilt, Segments};
pub use bad_frames::{BadFrames, BadFramesError, FrameFault};
pub use error::SimulateError;
pub use exposure::GainBias;
pub use fittings::fitting_options::Fittings;
pub use options::{Illumination, SimulateOptions, Wall};
pub use scene::Scene;
pub use sensor::BitDepth;
pub use survey_folder::{SimulationRecord, write_survey};
pub use texture::slanted_edge::SlantedEdge;
