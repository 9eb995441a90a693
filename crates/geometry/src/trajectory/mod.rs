//! Camera trajectories: poses, motion plans, pose noise, gyroscope integration and pose files.
//!
//! | format | its own convention | times | names |
//! | --- | --- | --- | --- |
//! | [`tum`] | camera-to-world, OpenCV's axes | seconds or nanoseconds | |
//! | [`kitti`] | camera-to-world, OpenCV's axes | | |
//! | [`mod@csv`] | camera-to-world, OpenCV's axes | seconds or nanoseconds, if there | if there |
//! | [`colmap`] | world-to-camera, OpenCV's axes | | yes |
//! | [`nerfstudio`] | camera-to-world, OpenGL's axes | | yes |
//! | `colmap_binary` (read only) | world-to-camera, OpenCV's axes | | yes |
//! | `euroc` (read only) | body-to-world | nanoseconds | |
//! | `opensfm` (read only) | world-to-camera, OpenCV's axes | | yes |
//! | `bundler` (read only) | world-to-camera, OpenGL's axes | | yes |
//! | `meshroom` (read only) | world-to-camera, OpenCV's axes | | yes |
//! | `openmvg` (read only) | world-to-camera, OpenCV's axes | | yes |
//! | `metashape` (read only) | camera-to-world, OpenCV's axes | | yes |
//! | `realitycapture` (read only) | camera-to-world, OpenGL's axes | | yes |
//! | `pix4d` (read only) | camera-to-world, OpenGL's axes | | yes |
//! | `own_json` (read only) | camera-to-world, OpenCV's axes | if there | if there |
//! | `record3d` (read only) | camera-to-world, OpenGL's axes | seconds, if there | |
//! | `recorded` (read only) | child-to-parent, as OpenCV's camera-to-world | seconds | |
//!
//! [`read_poses`] reads any of these formats without conversion; a [`Convention`] converts the
//! poses to the tunnel's frame.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch_geometry::trajectory::{PoseFormat, kitti, read_poses};
//!
//! let file = read_poses(Path::new("../../fixtures/blender_free48/baseline.tum"), None)?;
//! assert_eq!((file.format, file.entries.len()), (PoseFormat::Tum, 48));
//! let text = kitti::format(&file.trajectory());
//! assert_eq!(text.lines().count(), 48);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axes;
mod bundler;
pub mod colmap;
mod colmap_binary;
mod colmap_rig;
mod convention;
pub mod csv;
mod detection;
mod entry_list;
mod error;
mod euler;
mod euroc;
mod float;
mod format;
pub mod gyro;
mod iso_time;
mod jitter;
mod json_form;
pub mod kitti;
mod length_unit;
mod matrix_blocks;
mod matrix_files;
mod meshroom;
mod metashape;
mod mount;
mod nanoseconds;
pub mod nerfstudio;
mod open3d;
mod openmvg;
mod opensfm;
mod own_json;
mod own_keys;
mod pix4d;
mod plan;
mod pose;
mod pose_conflict;
mod pose_entry;
mod pose_file;
mod pose_options;
mod quaternion_order;
mod realitycapture;
mod record3d;
mod recorded;
mod rig;
mod rigid;
mod row;
pub mod se3;
mod shutter;
pub mod so3;
mod stamped_pose;
mod straight_path;
pub mod text;
mod time_unit;
pub mod times;
mod transform_tree;
pub mod tum;
mod tunnel_frame;

#[cfg(test)]
mod format_tests;

pub use axes::{CameraAxes, Direction};
pub use colmap_rig::is_rig_file;
pub use convention::Convention;
pub use csv::{ColumnMap, PoseColumn};
pub use entry_list::DuplicateTimes;
pub use error::PoseError;
pub use euler::{AngleUnit, EulerSequence};
pub use format::PoseFormat;
pub use jitter::{Jitter, JitterModel, MAX_SEARCH_VOLUME_DEG3};
pub use length_unit::LengthUnit;
pub use matrix_files::is_matrix_file;
pub use mount::{cameras_of_rigs, read_camera_in_body};
pub use plan::{Mounting, PlanTable, Rate, Station, UniformMotion, spiral};
pub use pose::Pose;
pub use pose_conflict::PoseConflict;
pub use pose_entry::PoseEntry;
pub use pose_file::{PoseFile, read_poses, read_poses_with};
pub use pose_options::PoseFileOptions;
pub use quaternion_order::QuaternionOrder;
pub use rig::Rig;
pub use shutter::Shutter;
pub use stamped_pose::{StampedPose, Trajectory, indexed, poses_of};
pub use straight_path::StraightPath;
pub use time_unit::TimeUnit;
pub use tunnel_frame::{TunnelAxis, read_tunnel_frame};
