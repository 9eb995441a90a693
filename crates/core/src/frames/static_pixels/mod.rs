//! Static pixels: what moves with the picture and not with the wall, such as burnt-in text, logos,
//! dirt on the lens, the carrier's own parts and black corners.
//!
//! ```text
//! frames ─> TemporalStatistics (mean, spread) ─┬─ ridges along the motion ─┐
//! MotionField ─────────────────────────────────┘                          ├─ outline ─> Mask
//!                          constant areas within edges ────────────────────┘
//! ```
//!
//! A pixel of the wall shows another wall point in every frame, so the detail of the temporal mean
//! shrinks by the root of the number of frames; that of an overlay stays.

mod constant_areas;
mod detection;
mod motion_field;
mod outline;
mod ridges;
mod temporal_statistics;
#[cfg(test)]
mod tests;

pub use detection::{StaticPixels, find_static_pixels};
pub use motion_field::{MotionCell, MotionField};
pub use temporal_statistics::TemporalStatistics;
