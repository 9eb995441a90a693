//! The report of a survey: one page to read and the numbers behind it.
//!
//! ```text
//! survey, poses ────────┐
//! files of refine ──────┼─ gather ──> Report ──> report.json
//! comparison, drawings ─┘        └──> pictures ──┤
//!                                                └─ page ──> report.html
//! ```
//!
//! [`Report`] holds everything that the page shows, and is written as `report.json`. The pictures
//! are written beside it under the names in the report, and are also embedded in the page, which
//! needs no other file and no network.
//!
//! | module | content |
//! | --- | --- |
//! | [`model`] | numbers of the report, computed by [`gather()`] |
//! | [`deformation`] | deformation of the wall |
//! | [`masked_wall`] | wall that was left out |
//! | [`refined_files`] | files that refine has written |
//! | [`pictures`] | strips of the panoramas, thumbnails |
//! | [`resolution`] | resolution of the compared panoramas |
//! | [`chart`] | line charts, with [`decimate`], [`ticks`] and [`quantity`] |
//! | [`heat_map`] | maps of the wall |
//! | [`page`](mod@page) | the page |

mod chart;
mod decimate;
mod deformation;
mod error;
mod gather;
mod heat_map;
mod masked_wall;
mod model;
mod page;
mod pictures;
mod quantity;
mod refined_files;
mod resolution;
mod ticks;

pub use deformation::Deformation;
pub use error::ReportError;
pub use gather::{Sources, gather};
pub use masked_wall::MaskedMap;
pub use model::{
    Abscissa, FrameRow, PanoramaStrips, Report, ResultSummary, SCHEMA_VERSION, Strip, SurveyFacts,
    Thumbnail, WallMaps,
};
pub use page::page;
pub use pictures::{PICTURES, Pictures};
pub use refined_files::{
    CalibratedUnknown, Calibration, OVERLAY_FILE, REFINEMENT_FILE, RefinedFiles, Refinement,
    SECTIONS_FILE, poses_file,
};
pub use resolution::{MAX_FRAME_BYTES, MAX_PIXELS, choose_resolution};
