//! Results that survive a crash: files that are complete or absent, checkpoints of long runs,
//! locks, and the provenance of a result.
//!
//! | subject | file |
//! | --- | --- |
//! | files and folders written under a temporary name, then renamed | [`atomic`] |
//! | states of a long run, to resume from | [`checkpoint`] |
//! | parts that one run hands over to another | [`part_file`] |
//! | shards of a long run, by their numbers | [`shard_number`] |
//! | locks against other programs | [`file_lock`] |
//! | what a result was made from and with | [`provenance`] |

pub mod atomic;
pub mod checkpoint;
pub mod file_lock;
mod hashed_file;
pub mod part_file;
pub mod provenance;
pub mod shard_number;

pub use atomic::remove_unfinished;
