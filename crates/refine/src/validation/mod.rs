//! Validation: frames are compared pair by pair, those that the others do not support are rejected,
//! and the trajectory is repaired.
//!
//! ```text
//! overlaps ─┬→ pairwise_ncc          → contradictions, blurred_frames ─┐
//!           └→ pairwise_lucas_kanade → inconsistent_frames ────────────┼→ repair
//!              alias_search          → alias_choice → aliasing ────────┘
//! ```
//!
//! Normalised cross-correlation tells whether two frames show the same wall, Lucas–Kanade how far
//! one is displaced against the other. On repetitive walls neither can tell a frame from its alias;
//! there the prior decides.

pub mod alias_choice;
pub mod alias_search;
pub mod aliasing;
pub mod alignment;
pub mod blurred_frames;
pub mod contradictions;
pub mod inconsistent_frames;
pub mod lucas_kanade_fit;
pub mod lucas_kanade_template;
pub mod overlaps;
pub mod pairwise_lucas_kanade;
pub mod pairwise_ncc;
pub mod repair;
