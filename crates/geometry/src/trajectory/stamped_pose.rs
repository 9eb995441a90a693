//! Poses with times.

use super::pose::Pose;

/// One pose of a trajectory with its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StampedPose {
    /// Seconds (or the frame's index, where no clock exists).
    pub time_s: f64,
    /// Camera-to-world pose.
    pub pose: Pose,
}

/// A trajectory: poses in the order of their frames, times strictly increasing.
pub type Trajectory = Vec<StampedPose>;

/// The poses of a trajectory, without their times.
pub fn poses_of(trajectory: &[StampedPose]) -> Vec<Pose> {
    trajectory.iter().map(|stamped| stamped.pose).collect()
}

/// A trajectory whose times are the frames' indices.
pub fn indexed(poses: impl IntoIterator<Item = Pose>) -> Trajectory {
    poses
        .into_iter()
        .enumerate()
        .map(|(k, pose)| StampedPose {
            time_s: k as f64,
            pose,
        })
        .collect()
}
