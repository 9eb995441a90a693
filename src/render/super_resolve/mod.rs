//! The wall finer than any frame.

mod footprints;
mod region;
mod roughness;
mod solve;

pub use footprints::{Footprints, View};
pub use region::Region;
