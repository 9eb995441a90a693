//! Convergence tests: how much noise of the poses the refinement can take, and whether it knows
//! when it was too much.
//!
//! ```text
//! ConvergeOptions ─ cells × seeds ──> draw a survey ─ simulate ─ refine ─ judge ──> runs.jsonl
//!                                     (again if nobody could fly it)                    │
//!                                          converge.json, converge.txt, converge.png <──┘
//! ```
//!
//! A *cell* is one point of the grid: noise model, wall, turn from frame to frame, rotation and
//! translation sigma. A *run* is one survey of a cell, by its seed. A run *succeeds* if every frame
//! is off by less than [`GOOD_PX`] on the wall. A *false success* is a frame that the refinement
//! calls photometric and that is not as good as that: the worst a repair can do is to be wrong and
//! sure.
//!
//! # The gauge
//!
//! A frame's error is its place relative to the rest of the trajectory, with nothing removed but
//! the tunnel's [gauge](crate::surface::Gauge). [`wall_error()`](super::wall_error()) fixes that by
//! least squares over all frames, which lets one lost frame spoil the others' figures. Here the
//! majority fixes it: [`majority_error()`] takes the shift under which the most frames are good, so
//! that lost frames are counted one by one. Where all frames are good the two agree.

mod cell;
mod draw;
mod efficiency;
mod error;

mod log;
mod majority;
mod map;
mod options;
mod run;
mod run_record;
mod summary;
mod table;

pub use cell::{Cell, SweepWall};
pub use efficiency::{Efficiency, PoseRms, efficiency};
pub use error::ConvergeError;
pub use majority::{MajorityError, majority_error};
pub use options::{ConvergeOptions, TranslationScale};
pub use run::{Swept, run};
pub use run_record::{RunRecord, Settings};
pub use summary::{CellSummary, Convergence};

/// Root mean square wall error of a frame below which it is good, pixels.
pub const GOOD_PX: f64 = 0.5;

/// Version of what runs.jsonl and converge.json hold; it changes when a field changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;
