//! One pose of a file.

use super::pose::Pose;

/// One pose of a file, in the file's own convention.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseEntry {
    /// The name of its frame, if the file has names.
    pub name: Option<String>,
    /// The camera of its frame in a model of COLMAP.
    pub camera: Option<u32>,
    /// Its time in seconds, if the file has times.
    pub time_s: Option<f64>,
    /// The pose.
    pub pose: Pose,
}

impl PoseEntry {
    /// The pose of a frame of that name, without a time.
    pub(super) fn named(name: impl Into<String>, pose: Pose) -> Self {
        Self {
            name: Some(name.into()),
            camera: None,
            time_s: None,
            pose,
        }
    }
}
