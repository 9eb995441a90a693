//! Surveys of tunnels that never were: known walls, known poses, known noise.
//!
//! ```text
//! SimulateOptions ─ Scene ──> plan, true poses, wall ─ Band (the wall as a raster) ─ cast ──> frames
//! ```
//!
//! What makes a survey harder is off unless asked for, each in a file of its own, in this order:
//!
//! ```text
//! wall ─ damp patches and glints ─ moving things ─ lamp ─ exposure ─┬─> Scene::render_exact
//!                                                                   └─ bad frames ─ sensor ──> frames
//! ```
//!
//! Each pixel is the mean of points spread over its square, between rays cast with a ray–wall
//! intersection of the simulator's own: it shares no warp code with the renderer or the estimator,
//! so that it can judge them.
//!
//! [`SimulateOptions::centred`], [`SimulateOptions::off_centre`] and [`SimulateOptions::free`] are
//! the three experiments of the paper (arXiv 1806.10278); [`run()`] writes a whole survey folder,
//! [`Scene`] renders single frames in memory.

mod bad_frames;
mod band;
mod brick;
mod caster;
mod concrete;
mod damp;
mod error;
mod exposure;
mod lamp;
mod moving;
mod noise;
mod options;
mod outline;
mod path;
mod picture;
mod run;
mod scene;
mod sensor;
mod shaft;
mod spoil;
mod target;
mod tunnel;
mod wall;

pub use bad_frames::{BadFrames, BadFramesError, Fault};
pub use error::SimulateError;
pub use exposure::Exposure;
pub use options::{Light, SimulateOptions, Wall};
pub use run::{Simulated, run};
pub use scene::Scene;
pub use sensor::Bits;
pub use target::SlantedEdge;
