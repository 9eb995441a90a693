//! Choice of the wall samples at which frames are compared.

pub mod footprints;
pub mod observer_marks;
pub mod outlier_mask;
pub mod point_sampler;
pub mod tile_coverage;
pub mod tile_selection;
pub mod visibility;
