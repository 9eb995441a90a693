//! The statistical model: what the estimator is given, what is known beforehand, and the state of each frame.

pub mod context;
pub mod frame_states;
pub mod prior;
pub mod problem_error;
pub mod rejection;
