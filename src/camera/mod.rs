//! Camera models: pixel → ray and point → pixel, with analytic Jacobians, and the calibration files they
//! come from.
//!
//! Pixel convention: the centre of the first pixel is (0, 0). Files that count from the corner
//! (`pixel_centre = "half"`) are converted when read.

mod calibration;
mod colmap;
mod pinhole;
mod radial;

pub use calibration::{CalibrationError, format_calibration, read_calibration};
pub use colmap::ColmapCamera;
pub use pinhole::Pinhole;
pub use radial::Radial;
