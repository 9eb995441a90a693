//! Recordings of robots: MCAP files of ROS 1 and ROS 2 and bags of ROS 1, and the messages in them
//! that a survey is made of.
//!
//! | subject | file |
//! | --- | --- |
//! | topics of a recording, and where each message lies | [`recording`] |
//! | records of MCAP | [`mcap`] |
//! | records of bags | [`rosbag`] |
//! | unpacking of chunks | [`chunk`] |
//! | numbers, texts and lists of records and messages | [`fields`] |
//! | images | [`picture`] |
//! | poses | [`recorded_pose`] |
//! | transforms between frames of reference | [`transforms`] |
//! | calibrations | [`camera_info`] |
//!
//! A recording is read once from its start to its end, chunk after chunk; afterwards each message
//! is read from its place. No more than a chunk is held in the memory.

pub mod camera_info;
pub mod chunk;
pub mod error;
pub mod fields;
mod index;
pub mod mcap;
pub mod picture;
pub mod place;
mod record_file;
pub mod recorded_pose;
pub mod recording;
pub mod rosbag;
pub mod stamp;
#[cfg(test)]
mod tests;
pub mod topic;
pub mod transforms;

pub use camera_info::CameraInfo;
pub use error::RecordingError;
pub use picture::{CompressedPicture, RawPicture, RecordedPicture};
pub use recorded_pose::{PoseTopic, RecordedPose};
pub use recording::{MessageReader, Recording, is_recording};
pub use topic::{Message, MessageKind, Topic, TopicGroup, Wire};
pub use transforms::{TransformLink, TransformLinks};
