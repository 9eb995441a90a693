//! One pose of a file.

use super::pose::Pose;

/// One pose of a file, in the file's own convention.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseEntry {
    /// The name of its frame, if the file has names.
    pub name: Option<String>,
    /// Its time in seconds, if the file has times.
    pub time_s: Option<f64>,
    /// The pose.
    pub pose: Pose,
}
