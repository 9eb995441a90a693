//! Convergence tests: the pose noise that the refinement tolerates, and whether it detects failure.
//!
//! ```text
//! ConvergeOptions ─ cells × seeds ─> feasible survey ─ simulate ─ refine ─ evaluate ─┐
//!                      ┌─────────────────────────────────────────────────────────────┘
//!                      └─> runs.jsonl ─> converge.json, converge.txt, converge.png
//! ```
//!
//! A *cell* is one point of the grid: noise model, wall, turn from frame to frame, rotation and
//! translation sigma. A *run* is one survey of a cell, by its seed. A survey is *feasible* if all
//! true poses are inside the tunnel and look at its wall. A run *succeeds* if the wall error of
//! every frame is below [`GOOD_PX`]. A *false success* is a frame that the refinement reports as
//! photometric although its error is larger, and larger than 3.5 of its stated σ: an undetected
//! failure.
//!
//! # The gauge
//!
//! A frame's error is its position relative to the rest of the trajectory, with nothing removed but
//! the tunnel's [gauge](tunnelstitch_geometry::surface::Gauge).
//! [`wall_error()`](super::wall_error()) fixes the gauge by least squares over all frames, so that
//! one lost frame spoils the others' figures. Here the majority fixes it: [`majority_error()`]
//! takes the shift under which the most frames are good, so that lost frames are counted one by
//! one. If all frames are good, the two agree.

mod deformation_errors;
mod efficiency;
mod error;
mod feasible_survey;
mod majority_error;
mod options;
mod run_log;
mod run_record;
mod success_map;
mod summary;
mod summary_table;
mod sweep;
mod sweep_cell;
mod wall_deformation;

pub use deformation_errors::DeformationErrors;
pub use efficiency::{Efficiency, ErrorRatio, PoseRms, measure_efficiency, plan_efficiency};
pub use error::ConvergeError;
pub use majority_error::{GOOD_PX, MajorityError, majority_error};
pub use options::{ConvergeOptions, TranslationScale};
pub use run_record::{RunRecord, SCHEMA_VERSION, Settings};
pub use summary::{CellSummary, Convergence};
pub use sweep::{SweepOutcome, SweepPlan, plan_sweep, run_sweep};
pub use sweep_cell::{SweepCell, SweepWall};
pub use wall_deformation::WallDeformation;
