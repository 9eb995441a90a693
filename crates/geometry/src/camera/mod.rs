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
mod cameras;
mod colmap;
mod double_sphere;
mod eucm;
mod field_of_view;
mod fov;
mod kannala_brandt;
mod lens;
mod lens_error;
mod lens_slip;
#[cfg(test)]
mod lens_tests;
mod mei;
mod ocam;
mod planar_inverse;
mod projection;
mod quotient;
mod radial;
mod single_precision;
mod sphere_share;
mod sweep;
mod thin_prism;

pub use brown_conrady::{BrownCoefficients, BrownConrady};
pub use calibration::{
    CalibrationError, format_calibration, read_calibration, read_calibration_of, stated_readout_ms,
};
pub use cameras::Cameras;
pub use colmap::{ColmapCamera, UnknownModelError};
pub use double_sphere::DoubleSphere;
pub use eucm::Eucm;
pub use field_of_view::FieldOfView;
pub use fov::Fov;
pub use kannala_brandt::KannalaBrandt;
pub use lens::Lens;
pub use lens_error::LensParameterError;
pub use lens_slip::LensSlip;
pub use mei::Mei;
pub use ocam::{OCAM_COEFFICIENTS, Ocam};
pub use projection::Camera;
pub use single_precision::{LensF32, LensLoop, ProjectF32};
pub use sweep::Sweep;
pub use thin_prism::{ThinPrismCoefficients, ThinPrismFisheye};
