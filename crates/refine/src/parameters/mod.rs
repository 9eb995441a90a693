//! Parameters that the estimator adjusts.
//!
//! | parameters | frames | number | file |
//! | --- | --- | --- | --- |
//! | pose (rotation, translation), log-gain, bias | each | 8 | [`frame_estimate`] |
//! | coefficients of the wall's shape | wall | 8 a block | [`shape`] |
//! | κ: intrinsics, radius, axis of the tunnel, readout time | all | up to 11 | [`calibration`] |
//!
//! The wall's texture is a nuisance parameter: it is eliminated
//! ([`crate::tiles::tile`]).

pub mod calibration;
pub mod frame_estimate;
pub mod shape;
pub mod shape_functions;
pub mod shape_limits;
pub mod unknowns;
pub mod unseen_errors;
pub mod wall_prior;
