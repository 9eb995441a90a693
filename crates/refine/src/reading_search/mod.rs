//! Search for the reading of poses and pictures that the pictures agree with.
//!
//! In a round tunnel a camera on the axis looks at the wall in every convention of its poses, in
//! either order of them, with quaternions that begin with w, and with poses that belong to other
//! frames. The geometry cannot tell these apart, but neighbouring frames can: read rightly, each is
//! found on the wall that the one before it shows, within what the prior allows
//! ([`register_frame`](crate::tracking::registration::register_frame)).
//!
//! ```text
//! pairs of neighbours → registered as given → registered in every other reading → odds
//! ```

mod comparison;
mod picture_pairs;
mod search;
mod telling_pairs;

pub use search::search_readings;
