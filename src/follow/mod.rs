//! Frames that are tracked and shown while they are taken.
//!
//! ```text
//! Capture (core) → LiveTracking (refine) → LiveWall (render) → preview files, status
//! ```
//!
//! Nothing of it goes into the result: that is refined from the frames when all are there.

mod live_preview;
mod live_status;

pub use live_preview::{FollowError, LivePreview, PREVIEW_FILES};
pub use live_status::LiveStatus;
