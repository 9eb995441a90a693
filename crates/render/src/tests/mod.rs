//! Rendering as a whole, on walls whose geometry and texture are known everywhere.

mod light;
mod panorama;
pub mod pictures;
mod projection;
