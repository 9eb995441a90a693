//! Shards: a long survey in stretches that are refined by themselves, and joined.
//!
//! ```text
//! survey ─> Shard ─> refine_shard: all stages as far as the last solve ─> ShardState ─┐
//!                    (one after another, or on many machines)                          │
//!                                               Refined <─ last solve, assessment <─ join_shards
//! ```
//!
//! Everything that makes up the search for the poses (tracking, checks, first solve, aliases) needs
//! a frame's neighbours only. So each stretch is a survey of its own, with frames of its neighbours
//! at its ends, and goes through the stages of any refinement as far as the last solve. Neighbours
//! have placed the frames that they share twice: that gives the motion along the gauge and the
//! exposure of one against the other, and a test that they agree. Then all frames are solved
//! together, from there, and assessed, as if one run had come so far.
//!
//! | step | file |
//! | --- | --- |
//! | stretches of a survey | [`division`] |
//! | the input of a stretch, and its run | [`refine_shard`] |
//! | what a stretch hands over | [`state`] |
//! | motion and exposure of one stretch against the one before | [`alignment`] |
//! | frames of all stretches in one tunnel | [`joined_frames`] |
//! | light, shared parameters and shape of all | [`joined_light`], [`joined_unknowns`], [`joined_shape`], [`joined_unseen`] |
//! | the refinement from there | [`join_shards`] |

pub mod alignment;
pub mod division;
pub mod join_shards;
pub mod joined_frames;
pub mod joined_light;
pub mod joined_shape;
pub mod joined_unknowns;
pub mod joined_unseen;
pub mod refine_shard;
pub mod state;
