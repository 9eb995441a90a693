//! The centreline of a curved tunnel.
//!
//! | subject | file |
//! | --- | --- |
//! | the line with its rotation-minimising frames | [`line`](mod@line) |
//! | the spline through the given points | [`spline`] |
//! | bends too tight for the section, and a tunnel that meets itself | [`self_intersection`] |

mod line;
mod self_intersection;
mod spline;

pub use line::{CentrePoint, Centreline, CentrelineFrame};
