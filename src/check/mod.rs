//! Check of a survey before it is refined: frames, overlap, expected jitter, texture, effort, and
//! what to do about them.
//!
//! Up to 64 frames are decoded; of the others only start and end are read.
//! Everything else is geometry of the initial poses.
//!
//! ```text
//! Survey ─┬─ MaskCheck, PosesCheck, OverlapCheck, JitterCheck ─┐
//!         ├─ PictureCheck (a dozen frames) ────────────────────┼─> Check ── warnings
//!         ├─ OverlayReport (up to 64 frames) ──────────────────┤
//!         ├─ DeformationCheck (bound by texture and overlap) ──┤
//!         └─ Effort (time and memory) ─────────────────────────┘
//! ```

mod deformation;
mod effort;
mod interlacing;
mod jitter;
mod masks;
mod overlap;
mod pictures;
mod poses;
mod result;
mod run;
mod statistics;
mod warnings;

pub use deformation::DeformationCheck;
pub use effort::{
    Effort, JOIN_SHARE, join_bytes, refine_bytes, refine_processor_s, refine_s, shard_bytes,
    shard_share,
};
pub use interlacing::interlacing_warning;
pub use jitter::JitterCheck;
pub use masks::MaskCheck;
pub use overlap::OverlapCheck;
pub use pictures::PictureCheck;
pub use poses::PosesCheck;
pub use result::Check;
pub use run::check;
