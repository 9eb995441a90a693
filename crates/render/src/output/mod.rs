//! From bands to panoramas, files and reports about them, within the memory there is.
//!
//! | subject | file |
//! | --- | --- |
//! | frames and poses to a panorama | [`stitch`] |
//! | bands drawn one after the other | [`plan`] |
//! | memory needed and free | [`budget`], [`memory`] |
//! | panorama in memory | [`panorama`] |
//! | panorama in a raster file, and small with axes | [`raster_target`], [`preview`] |
//! | wall that no frame shows | [`gaps`] |
//! | wall while frames are taken | [`live_wall`] |
//! | resolution and uncertainty over the wall | [`maps`] |
//! | one photo on a cylinder around its camera | [`cylinder`] |

pub mod budget;
pub mod cylinder;
pub mod gaps;
pub mod live_wall;
pub mod maps;
pub mod memory;
pub mod panorama;
pub mod panorama_files;
pub mod panorama_progress;
pub mod plan;
pub mod preview;
pub mod raster_target;
pub mod stitch;
