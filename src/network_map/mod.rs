//! The map of a network: a GeoPackage of its sections, manholes and defects.
//!
//! ```text
//! network.toml ─> SectionLine ───────────────┐
//! job.json, state/ ─> SectionState ──────────┼─> layers ─> GeoPackage
//! refine.json, sections.csv ─> Accuracy,     │
//!                              Deformation ──┤
//! marks.geojson ─────────────────────────────┘
//! ```
//!
//! | subject | file |
//! | --- | --- |
//! | the file format | [`GeoPackage`] |
//! | what its layers have of a network | [`draw_map()`] |
//! | how the work on a section ended | [`SectionState`] |
//! | what was measured | `figures` |

mod error;
mod figures;
mod geometry;
mod geopackage;
mod layers;
mod section_state;

pub use error::MapError;
pub use geometry::Geometry;
pub use geopackage::{Column, ColumnType, Feature, GeoPackage, Layer};
pub use layers::draw_map;
pub use section_state::SectionState;
