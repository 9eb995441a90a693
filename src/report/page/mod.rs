//! `report.html`: the report as one page that needs no other files.
//!
//! There is one file per section. A section formats a part of [`Report`](super::Report). Without
//! scripts everything is visible; with scripts the panoramas lie over each
//! other and charts show the values at the pointer.

mod convergence;
mod corrections;
mod deformation;
mod document;
mod errors;
mod flagged;
mod map_strip;
mod masked_wall;
mod page_data;
mod panorama;
mod parameters;
mod section_plot;
mod summary;
mod trajectory;
mod wall_maps;

pub use document::page;
