//! Surveys of tunnels that never were: known walls, known poses, known noise.
//!
//! ```text
//! SimulateOptions ─ Scene ──> plan, true poses, wall ─ Band (the wall as a raster) ─ cast ──> frames
//! ```
//!
//! Each pixel is the mean of supersampled rays, cast with a ray–wall intersection of the simulator's own: it
//! shares no warp code with the renderer or the estimator, so that it can judge them.
//!
//! [`SimulateOptions::centred`], [`SimulateOptions::off_centre`] and [`SimulateOptions::free`] are the three
//! experiments of the paper (arXiv 1806.10278); [`run()`] writes a whole survey folder, [`Scene`] renders single
//! frames in memory.

mod band;
mod brick;
mod caster;
mod concrete;
mod error;
mod noise;
mod options;
mod picture;
mod run;
mod scene;
mod wall;

pub use error::SimulateError;
pub use options::{Light, SimulateOptions, Wall};
pub use run::{Simulated, run};
pub use scene::Scene;
