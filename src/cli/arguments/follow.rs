//! Arguments of following frames while they are taken.

use super::numbers::positive;
use std::time::Duration;

/// Arguments of following frames while they are taken.
#[derive(Debug, clap::Args)]
pub struct FollowArguments {
    /// Follow the frames while they are taken: track each picture that appears in the folder
    /// (frames.images) and write preview.tum, preview.png and a line with the gaps in the wall, of
    /// provisional poses; when the capture ends, refine all frames as without it, to the same
    /// bytes. The file of poses is that of a plan, or grows with the frames. Ctrl-C once ends the
    /// capture. Pictures in a pipe are not read: have the program that writes them fill a folder
    /// (ffmpeg -i … frames/%06d.png).
    #[arg(long, conflicts_with_all = ["shard", "join"])]
    pub follow: bool,
    /// Seconds without a new picture after which the capture has ended, counted from the first one.
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, value_parser = positive)]
    follow_until: f64,
}

impl FollowArguments {
    /// Time without a new picture after which the capture has ended.
    pub fn patience(&self) -> Duration {
        Duration::try_from_secs_f64(self.follow_until).unwrap_or(Duration::MAX)
    }
}
