//! From pixels of a tile into a frame.
//!
//! | subject | file |
//! | --- | --- |
//! | projection of wall points near an origin, in single precision | [`projection`] |
//! | patches of 32 × 32 pixels that a tile is cut into | [`patches`] |
//! | points of each patch that are projected exactly | [`control_points`] |
//! | cubic polynomials through them, one patch at a time | [`local_polynomial`] |

pub mod control_points;
pub mod local_polynomial;
pub mod patches;
pub mod projection;
