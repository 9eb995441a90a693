//! Checks of each frame against the others, and repair of what fails them.

pub mod aliasing;
pub mod inconsistent_frames;
pub mod overlaps;
pub mod pairwise_lucas_kanade;
pub mod pairwise_ncc;
pub mod repair;
