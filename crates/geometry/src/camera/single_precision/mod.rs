//! Lens models in single precision, for loops over many points.
//!
//! A loop is generic over [`ProjectF32`] and instantiated per lens model, not over the enum, so
//! that the compiler can vectorise it.

mod angle;
mod chebyshev;
mod fisheye;
mod lens;
mod perspective;
mod polynomial;
mod project;
mod rolling_shutter;
mod sphere;
mod wide_angle;

pub use lens::LensF32;
pub use project::{LensLoop, ProjectF32};
