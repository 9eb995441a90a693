//! The report of a survey: one page to read and the numbers behind it.
//!
//! ```text
//! survey, poses ────────┐
//! refine.json ─ Refined ┼─ gather ──> Report ──> report.json
//! comparison, drawings ─┘        └──> pictures ──┤
//!                                                └─ page ──> report.html
//! ```
//!
//! All that the page says is in [`Report`], which is `report.json`; the pictures lie beside it
//! under the names that it gives, and are inside the page, which needs no other file and no
//! network.
//!
//! | what | where |
//! | --- | --- |
//! | the numbers | [`model`], made by [`gather()`] |
//! | what refine has left | [`refined`] |
//! | panoramas cut into strips, thumbnails | [`pictures`], at the [`resolution()`] of the comparison |
//! | line charts | [`chart`], with [`decimate`], [`ticks`] and [`quantity`] |
//! | maps of the wall | [`heat`] |
//! | the page | [`page()`] |

mod chart;
mod decimate;
mod error;
mod gather;
mod heat;
mod model;
mod page;
mod pictures;
mod quantity;
mod refined;
mod resolution;
mod ticks;

pub use error::ReportError;
pub use gather::{Sources, gather};
pub use model::{
    Abscissa, FrameRow, PanoramaStrips, Report, SCHEMA_VERSION, Strip, SurveyFacts, Thumbnail,
    Verdict, WallMaps,
};
pub use page::page;
pub use pictures::{PICTURES, Pictures};
pub use refined::{CalibratedUnknown, Calibration, RefinedFiles, Refinement};
pub use resolution::resolution;
