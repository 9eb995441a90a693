//! Poses: `nav_msgs/Odometry`, `geometry_msgs/PoseStamped` and `PoseWithCovarianceStamped`, and
//! the transforms of `tf2_msgs/TFMessage`.
//!
//! Each holds a position, metres, and a quaternion x y z w: the motion from the child's frame of
//! reference (`child_frame_id`) to the parent's (`frame_id`).

use super::error::RecordingError;
use super::fields::Fields;
use super::recording::Recording;
use super::stamp::Header;
use super::topic::{MessageKind, Topic, TopicGroup, Wire};
use std::collections::BTreeMap;

/// Most transforms of one message: a robot has some hundred parts.
const MAX_TRANSFORMS: u32 = 10_000;

/// The poses to be read from a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseTopic {
    /// The topic; by default the only one with poses.
    pub topic: Option<String>,
    /// The fixed frame of a transform; by default the parent of the only transform of the topic.
    pub parent: Option<String>,
    /// The frame whose poses are read. Between the two there may be others.
    pub child: Option<String>,
}

/// A pose of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedPose {
    /// The time of its header, seconds.
    pub time_s: f64,
    /// Position, metres.
    pub position: [f64; 3],
    /// Quaternion x y z w.
    pub quaternion: [f64; 4],
}

impl RecordedPose {
    fn read(time_s: f64, fields: &mut Fields<'_>) -> Result<Self, String> {
        Ok(Self {
            time_s,
            position: fields.f64s()?,
            quaternion: fields.f64s()?,
        })
    }
}

/// Poses by the names of parent and child; both are empty for messages that are not transforms.
pub(super) type ByFrames = BTreeMap<(String, String), Vec<RecordedPose>>;

impl Recording {
    /// Reads the poses of a topic, sorted by time.
    ///
    /// # Errors
    /// No such topic, or several and no name; no such transform, or several and no names; a
    /// message that ends too early.
    pub fn poses(&self, wanted: &PoseTopic) -> Result<Vec<RecordedPose>, RecordingError> {
        let topic = self.topic(TopicGroup::Poses, wanted.topic.as_deref())?;
        let mut poses = choose(self.poses_of(topic)?, wanted).map_err(|what| {
            let what = format!("topic {}: {what}", topic.name);
            RecordingError::content(self.path(), what)
        })?;
        poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Ok(poses)
    }

    /// Reads the poses of a topic, in the order of the file.
    ///
    /// # Errors
    /// A message that ends too early; an unreadable file.
    pub(super) fn poses_of(&self, topic: &Topic) -> Result<ByFrames, RecordingError> {
        let mut found = ByFrames::new();
        let mut reader = self.reader()?;
        for (k, message) in topic.messages.iter().enumerate() {
            let bytes = reader.read(message)?;
            // Its kind is one of poses, or the topic would not be.
            let Some(content) = topic.content else {
                continue;
            };
            add(&bytes, content, &mut found).map_err(|what| {
                let what = format!("topic {}, message {k}: {what}", topic.name);
                RecordingError::content(self.path(), what)
            })?;
        }
        Ok(found)
    }
}

/// Reads the poses of a message.
fn add(
    message: &[u8],
    (kind, wire): (MessageKind, Wire),
    found: &mut ByFrames,
) -> Result<(), String> {
    let mut fields = wire.fields(message)?;
    if kind == MessageKind::Transforms {
        let count = fields.u32()?;
        if count > MAX_TRANSFORMS {
            return Err(format!(
                "{count} transforms, of which at most {MAX_TRANSFORMS} are read"
            ));
        }
        for _ in 0..count {
            let header = Header::read(&mut fields, wire)?;
            let child = fields.text()?;
            let pose = RecordedPose::read(header.time_s, &mut fields)?;
            let frames = (header.frame_id.to_owned(), child.to_owned());
            found.entry(frames).or_default().push(pose);
        }
        return Ok(());
    }
    let header = Header::read(&mut fields, wire)?;
    if kind == MessageKind::Odometry {
        // The child's name.
        fields.text()?;
    }
    let pose = RecordedPose::read(header.time_s, &mut fields)?;
    found.entry(Default::default()).or_default().push(pose);
    Ok(())
}

/// The poses of the wanted parent and child.
fn choose(mut found: ByFrames, wanted: &PoseTopic) -> Result<Vec<RecordedPose>, String> {
    let is_wanted = |(parent, child): &&(String, String)| {
        let fits = |name: &Option<String>, own: &str| name.as_deref().is_none_or(|n| n == own);
        fits(&wanted.parent, parent) && fits(&wanted.child, child)
    };
    let fitting: Vec<_> = found.keys().filter(is_wanted).cloned().collect();
    if let [frames] = fitting.as_slice() {
        return Ok(found.remove(frames).unwrap_or_default());
    }
    let line = |((parent, child), poses): (&(String, String), &Vec<_>)| {
        format!("{parent} to {child} ({})", poses.len())
    };
    let all: Vec<String> = found.iter().map(line).collect();
    Err(format!(
        "name the fixed frame and the camera's by `parent` and `child` under [poses]; its \
         transforms are {}",
        all.join(", ")
    ))
}
