//! Validation: frames are compared pair by pair, those that the others do not support are rejected,
//! and the trajectory is repaired.
//!
//! ```text
//! overlaps → pairwise_lucas_kanade → inconsistent_frames ─┬→ repair
//!            alias_search → alias_choice → aliasing ──────┘
//! ```
//!
//! One pass over the overlaps measures all that a pair of frames tells: their displacement
//! ([`lucas_kanade_template`]), whether they show the same wall ([`patch_correlation`]), and which
//! of them is sharper. On repetitive walls it cannot tell a frame from its alias; there the prior
//! decides.

pub mod alias_choice;
pub mod alias_search;
pub mod aliasing;
pub mod alignment;
pub mod inconsistent_frames;
pub mod lucas_kanade_fit;
pub mod lucas_kanade_template;
pub mod overlaps;
pub mod pairwise_lucas_kanade;
pub mod patch_correlation;
pub mod repair;
