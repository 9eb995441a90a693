//! Simulated surveys: known walls, known poses, known noise.
//!
//! ```text
//! SimulateOptions ─ Scene ─> plan, true poses, wall ─ WallRaster ─ cast_rays ─> frames
//! ```
//!
//! Every degradation is off by default, has a file of its own, and is applied in this order:
//!
//! ```text
//! wall ─ wet patches ─ camera lamp, fog ─ cables, lamps ─ interlacing, motion blur ─┐
//!   ┌────────────────────────────────────────────────────────────────────────────────┘
//!   └─ moving objects ─ vignetting ─ shaft of the rig ─ defocus ─ dust ─ flicker ─┐
//!   ┌──────────────────────────────────────────────────────────────────────────────┘
//!   └─ darkness ─ exposure ─┬─> Scene::render_exact
//!                           └─ fault injection ─ sensor noise ─ tone curve ─ overlay ─┐
//!   ┌──────────────────────────────────────────────────────────────────────────────────┘
//!   └─ rounding ─ JPEG ─> frames
//! ```
//!
//! The first line is a matter of rays; the steps from moving objects to the overlay are the effects
//! of the folder `effects`.
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
mod camera_lamp;
mod camera_path;
mod cross_section;
mod effects;
mod error;
mod false_position;
mod fittings;
mod fog;
mod frame_motion;
#[cfg(test)]
mod imaging_tests;
mod lamp_light;
mod lining;
mod motion_blur;
mod options;
mod planned_path;
mod procedural_noise;
mod ray_casting;
mod ray_rows;
mod rendering;
mod rig;
mod scene;
mod survey_folder;
mod texture;
mod tunnel;
mod unrolled_wall;
mod visible_wall;
mod wall_intersection;
mod wall_light;
mod wall_raster;
mod wall_stretches;
mod wall_view;
mod wet_patches;

pub use as_built::{AsBuilt, Segments};
pub use bad_frames::{BadFrames, BadFramesError, FrameFault};
pub use camera_lamp::CameraLamp;
pub use effects::effect_options::{FrameEffects, OverlayParts};
pub use effects::exposure::GainBias;
pub use effects::flicker::Flicker;
pub use effects::sensor::BitDepth;
pub use error::SimulateError;
pub use fittings::fitting_options::Fittings;
pub use options::{Illumination, SimulateOptions, Wall};
pub use rig::RigOptions;
pub use scene::Scene;
pub use survey_folder::{SimulationRecord, check_survey, stage_survey, write_survey};
pub use texture::slanted_edge::SlantedEdge;
