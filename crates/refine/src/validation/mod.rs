//! Validation: frames are compared pair by pair, those that the others do not support are rejected,
//! and those that fit at several places are moved to where the prior has them.
//!
//! ```text
//! overlaps → pairwise_ncc → inconsistent_frames, blurred_frames
//! alias_search → alias_choice → aliasing
//! ```
//!
//! Normalised cross-correlation tells whether two frames show the same wall. On repetitive walls it
//! cannot tell a frame from its alias; there the prior decides.

pub mod alias_choice;
pub mod alias_search;
pub mod aliasing;
pub mod blurred_frames;
pub mod disagreement;
pub mod inconsistent_frames;
pub mod overlaps;
pub mod pairwise_ncc;
