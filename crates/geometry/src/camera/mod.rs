//! Camera models: back-projection (pixel → ray), projection (point → pixel) with analytic
//! Jacobians, and calibration files.
//!
//! Pixel convention: the centre of the first pixel is (0, 0). Files that count from the corner of
//! the first pixel (`pixel_centre = "half"`, COLMAP, nerfstudio) are converted when read.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch_geometry::camera::read_calibration;
//!
//! let camera = read_calibration(Path::new("../../fixtures/blender_free48/camera.json"), None)?;
//! let ray = camera.ray(12.5, 40.0).ok_or("the lens shows nothing there")?;
//! let pixel = camera.project(&ray).ok_or("behind the camera")?;
//! assert!((pixel.x - 12.5).abs() < 1e-9 && (pixel.y - 40.0).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod brown_conrady;
mod calibration;
mod colmap;
mod kannala_brandt;
mod lens;
mod monotone;
mod projection;
mod single_precision;
mod sweep;

pub use brown_conrady::{BrownCoefficients, BrownConrady};
pub use calibration::{CalibrationError, format_calibration, read_calibration};
pub use colmap::ColmapCamera;
pub use kannala_brandt::KannalaBrandt;
pub use lens::Lens;
pub use projection::Camera;
pub use single_precision::{LensF32, ProjectF32};
pub use sweep::Sweep;
