//! Rendering as a whole, on walls whose geometry and texture are known everywhere.

mod panorama;
pub mod pictures;
mod projection;
