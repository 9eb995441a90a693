//! The statistical model: inputs, prior, and the state of each frame.
//!
//! ```text
//! initial poses, jitter ──> Prior ─┐
//! camera, surface, frames ─────────┴─> EstimationContext ─┐
//! FrameStates (estimates, rejections) ──> FrameWindow ────┴─> a problem
//! ```
//!
//! [`prior`] adds the prior to the normal equations; [`prior_terms`] has its errors and Jacobians.
//! [`rejection`] lists the reasons to reject a frame, [`problem_error`] the failures of a problem.

pub mod context;
pub mod frame_states;
pub mod prior;
pub mod prior_terms;
pub mod problem_error;
pub mod rejection;
