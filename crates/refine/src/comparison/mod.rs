//! Comparison of frames on the wall, by the normalised correlation of their local contrast.
//!
//! ```text
//! unwrapped_frame, mosaic_grid → ncc_score
//! overlaps → pairwise_ncc → inconsistent_frames, blurred_frames
//! ```
//!
//! Normalised cross-correlation tells whether two frames show the same wall. On repetitive walls it
//! cannot tell a frame from its alias; there the prior decides ([`crate::validation`]).

pub mod blurred_frames;
pub mod inconsistent_frames;
pub mod mosaic_grid;
pub mod ncc_score;
pub mod overlaps;
pub mod pairwise_ncc;
pub mod unexplained;
pub mod unwrapped_frame;
