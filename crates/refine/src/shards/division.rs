//! Stretches of a survey.

use crate::options::RefineOptions;
use crate::thresholds::tracking::LONG_WINDOW_FRAMES;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Frames of its neighbours that a stretch has at either end: both of two neighbours have as many
/// in common as a long window of tracking, in which a bend straightens.
const BESIDE_FRAMES: usize = LONG_WINDOW_FRAMES / 2;

/// Memory for decoded frames of a stretch, where a survey is refined in several, bytes.
pub const SHARD_CACHE_BYTES: usize = 256 << 20;

/// Memory for decoded frames where stretches are joined, bytes: the equations of all frames need
/// the rest, and a long survey's frames would not fit into several times as much.
pub const JOIN_CACHE_BYTES: usize = 128 << 20;

/// A stretch of a survey's frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Its place among all stretches, from 1.
    pub number: usize,
    /// Number of stretches.
    pub of: usize,
    /// The frames that are its own.
    pub own: Range<usize>,
    /// These, and those of its neighbours that it is refined with.
    pub frames: Range<usize>,
}

impl Shard {
    /// Stretch `number` (from 1) of `of` equal ones of a survey of `frames` frames, in which
    /// moments of a rig of `cameras` cameras stay whole; None if there is none, or if it has no
    /// frames.
    pub fn new(number: usize, of: usize, frames: usize, cameras: usize) -> Option<Self> {
        let moments = frames / cameras.max(1);
        if number == 0 || number > of || moments < of {
            return None;
        }
        let start = |number: usize| (number - 1) * moments / of;
        let own = start(number)..start(number + 1);
        let beside = BESIDE_FRAMES.div_ceil(cameras.max(1));
        let all = own.start.saturating_sub(beside)..(own.end + beside).min(moments);
        let [own, frames] =
            [own, all].map(|moments| moments.start * cameras.max(1)..moments.end * cameras.max(1));
        Some(Self {
            number,
            of,
            own,
            frames,
        })
    }

    /// Place of a frame of the survey among those of the stretch; it must be one of them.
    pub fn place(&self, frame: usize) -> usize {
        frame - self.frames.start
    }
}

/// The options for a survey in so many stretches, with at most so much memory for decoded frames if
/// there are several.
pub fn options_of(options: &RefineOptions, stretches: usize, cache_bytes: usize) -> RefineOptions {
    let mut own = options.clone();
    if stretches > 1 {
        own.cache_bytes = own.cache_bytes.min(cache_bytes);
    }
    own
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_cover_a_survey_and_reach_into_their_neighbours() {
        for (of, frames, cameras) in [(1, 2, 1), (3, 1000, 1), (4, 906, 3), (2, 14, 1)] {
            let shards = (1..=of).map(|number| Shard::new(number, of, frames, cameras).unwrap());
            let shards: Vec<Shard> = shards.collect();
            assert_eq!(shards[0].own.start, 0);
            assert_eq!(shards[of - 1].own.end, frames);
            for pair in shards.windows(2) {
                assert_eq!(pair[0].own.end, pair[1].own.start);
                let common = pair[1].frames.start..pair[0].frames.end;
                assert!(common.len() >= LONG_WINDOW_FRAMES.min(frames), "{common:?}");
                assert!(common.start % cameras == 0 && common.end % cameras == 0);
            }
            assert!(shards.iter().all(|shard| shard.frames.end <= frames));
        }
        assert_eq!(Shard::new(3, 2, 100, 1), None);
        assert_eq!(Shard::new(0, 2, 100, 1), None);
        assert_eq!(Shard::new(1, 5, 4, 1), None);
    }
}
