//! Parameters that the estimator adjusts.
//!
//! | parameters | per | number | file |
//! | --- | --- | --- | --- |
//! | pose (rotation, translation), log-gain, bias | frame | 8 | [`frame_estimate`] |
//! | intrinsics, radius, axis of the tunnel, readout time: κ | survey | up to 11 | [`calibration`] |
//!
//! The wall's texture is a nuisance parameter: it is eliminated
//! ([`crate::refine::tiles::tile`]).

pub mod calibration;
pub mod frame_estimate;
