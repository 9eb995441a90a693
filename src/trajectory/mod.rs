//! Where the camera was: poses, the plan they should have followed, the jitter that moved them off
//! it, and the files they are kept in.
//!
//! | format | its own convention | times | names |
//! | --- | --- | --- | --- |
//! | [`tum`] | camera-to-world, OpenCV's axes | seconds | |
//! | [`kitti`] | camera-to-world, OpenCV's axes | | |
//! | [`mod@csv`] | camera-to-world, OpenCV's axes | seconds or nanoseconds, if there | if there |
//! | [`colmap`] | world-to-camera, OpenCV's axes | | yes |
//! | [`nerfstudio`] | camera-to-world, OpenGL's axes | | yes |
//! | `euroc` (read only) | body-to-world | nanoseconds | |
//!
//! [`read_poses`] reads any of them as they are; a [`Convention`] says what the numbers mean and
//! makes poses of the tunnel of them.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch::trajectory::{PoseFormat, kitti, read_poses};
//!
//! let file = read_poses(Path::new("fixtures/blender_free48/baseline.tum"), None)?;
//! assert_eq!((file.format, file.entries.len()), (PoseFormat::Tum, 48));
//! let text = kitti::format(&file.trajectory());
//! assert_eq!(text.lines().count(), 48);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod colmap;
mod convention;
pub mod csv;
mod error;
mod euroc;
mod file;
mod format;
pub mod gyro;
mod jitter;
pub mod kitti;
mod mount;
pub mod nerfstudio;
mod plan;
mod pose;
mod rigid;
pub mod se3;
mod shutter;
pub mod so3;
pub(crate) mod text;
pub(crate) mod times;
pub mod tum;
mod tunnel_frame;

#[cfg(test)]
mod format_tests;

pub use convention::{CameraAxes, Convention, Direction};
pub use error::PoseError;
pub use file::{PoseEntry, PoseFile, read_poses};
pub use format::PoseFormat;
pub use jitter::{Jitter, JitterModel};
pub use mount::read_camera_in_body;
pub use plan::{Mounting, PlanTable, Rate, Station, Steady, spiral};
pub use pose::Pose;
pub use shutter::Shutter;
pub use tunnel_frame::{TunnelAxis, read_tunnel_frame};

/// One pose of a trajectory with its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StampedPose {
    /// Seconds (or the frame's index, where no clock exists).
    pub time_s: f64,
    /// Camera-to-world pose.
    pub pose: Pose,
}

/// Poses in the order of their frames, times strictly increasing.
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
