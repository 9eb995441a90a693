//! One pose of a file.

use super::pose::Pose;

/// One pose of a file, in the file's own convention.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PoseEntry {
    /// The frame it belongs to, if the file says so.
    pub name: Option<String>,
    /// Its time in seconds, if the file says so.
    pub time_s: Option<f64>,
    /// The pose.
    pub pose: Pose,
}
