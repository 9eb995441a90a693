//! Selection of the wall samples at which frames are compared.
//!
//! ```text
//! poses ─> footprints ─> tile_candidates ─> tile_projection ─> Visibility (tile, observers)
//!                                                                  │
//! images ──> OutlierMask (observers that do not show the wall) ────┤
//!                                                                  ▼
//!                                          TileCoverage, stretch by stretch
//! ```
//!
//! [`hidden_bands`] finds where the outlier mask has left out most of the wall along the tunnel.
//! [`sampling`] holds the settings of a problem. [`point_sampler`] projects single wall points and
//! is used by tracking and validation.

pub mod excluded_tiles;
pub mod footprints;
pub mod hidden_bands;
pub mod observer;
pub mod observer_marks;
pub mod outlier_mask;
pub mod point_sampler;
pub mod sampling;
pub mod tile_candidates;
pub mod tile_coverage;
pub mod tile_projection;
pub mod viewpoint;
pub mod visibility;
