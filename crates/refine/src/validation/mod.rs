//! Validation: frames of which too many pixels disagree are rejected, and those that fit at several
//! places are moved to where the prior has them.
//!
//! ```text
//! alias_search → alias_choice → aliasing
//! ```

pub mod alias_choice;
pub mod alias_search;
pub mod aliasing;
pub mod disagreement;
