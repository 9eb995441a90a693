//! Parameters that the estimator adjusts: each frame's pose and exposure, and what all frames share.

pub mod calibration;
pub mod frame_estimate;
