//! The state of a stretch that has been refined as far as the last solve.

use crate::shards::division::Shard;
use crate::stages::state::Snapshot;
use serde::{Deserialize, Serialize};

/// The state of a stretch before the last solve, as it is handed over to where all are joined.
#[derive(Debug, Serialize, Deserialize)]
pub struct ShardState {
    /// The stretch.
    pub shard: Shard,
    /// The state; None if its equations have no solution: its initial poses are all that is known.
    pub(super) snapshot: Option<Box<Snapshot>>,
}

/// A stretch of the straight tunnel.
pub struct StraightShard {
    /// The stretch.
    pub shard: Shard,
    /// Its end; None if its equations have no solution.
    pub end: Option<ShardEnd>,
}

/// The end of a stretch in the straight tunnel.
pub struct ShardEnd {
    /// The state, without the bend.
    pub snapshot: Box<Snapshot>,
    /// The bend's curvature, 1/m.
    pub bend_per_m: [f64; 2],
}
