//! The transforms between frames of reference: `tf` and `tf_static` of one robot together.
//!
//! Names that tf 1 writes with a slash before them are those without. Source: `tf2_msgs/TFMessage`,
//! docs.ros.org; ROS wiki, "tf2/Migration".

use super::error::RecordingError;
use super::recorded_pose::RecordedPose;
use super::recording::Recording;
use super::topic::{MessageKind, Topic, TopicGroup};
use std::collections::BTreeMap;

/// Last part of the name of a topic with transforms that do not change.
const STATIC_NAME: &str = "tf_static";
/// Last parts of the names of topics whose transforms form one tree.
const NAMES: [&str; 2] = ["tf", STATIC_NAME];

/// The transforms from a child's frame of reference to its parent's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransformLink {
    /// True for a transform that does not change; the last one counts.
    pub is_static: bool,
    /// The transforms, sorted by time.
    pub transforms: Vec<RecordedPose>,
}

/// Links by the names of child and parent.
pub type TransformLinks = BTreeMap<(String, String), TransformLink>;

impl Recording {
    /// Reads all transforms of a topic, and of `tf` and `tf_static` in its namespace. Without a
    /// name, the topic is the only one called `tf`; nothing is read if there is no such topic, or
    /// several. A transform on both topics changes.
    ///
    /// # Errors
    /// A message that ends too early; an unreadable file.
    pub fn transform_links(&self, topic: Option<&str>) -> Result<TransformLinks, RecordingError> {
        let mut links = TransformLinks::new();
        for topic in self.transform_topics(topic) {
            let is_static = last_part(&topic.name) == STATIC_NAME;
            for ((parent, child), transforms) in self.poses_of(topic)? {
                let frames = (plain(&child), plain(&parent));
                let link = links.entry(frames).or_insert_with(|| TransformLink {
                    is_static,
                    transforms: Vec::new(),
                });
                if link.is_static && !is_static {
                    *link = TransformLink::default();
                }
                if link.is_static == is_static {
                    link.transforms.extend(transforms);
                }
            }
        }
        for link in links.values_mut() {
            let transforms = &mut link.transforms;
            transforms.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        }
        Ok(links)
    }

    /// The topics of the tree that a topic belongs to.
    fn transform_topics(&self, wanted: Option<&str>) -> Vec<&Topic> {
        let all = self.topics(TopicGroup::Poses);
        let all = all.filter(|t| matches!(t.content, Some((MessageKind::Transforms, _))));
        let all: Vec<&Topic> = all.collect();
        let is_wanted = |topic: &&&Topic| match wanted {
            Some(name) => topic.name == name,
            None => last_part(&topic.name) == NAMES[0],
        };
        let mut fitting = all.iter().filter(is_wanted);
        let (Some(topic), None) = (fitting.next(), fitting.next()) else {
            return Vec::new();
        };
        let is_in_tree = |topic: &Topic| NAMES.contains(&last_part(&topic.name));
        let belongs = |other: &&&Topic| {
            let is_beside = namespace(&other.name) == namespace(&topic.name);
            other.name == topic.name || (is_beside && is_in_tree(other) && is_in_tree(topic))
        };
        all.iter().filter(belongs).copied().collect()
    }
}

/// The name of a frame without the slash that tf 1 puts before it.
pub fn plain(frame: &str) -> String {
    frame.strip_prefix('/').unwrap_or(frame).to_owned()
}

/// The name of a topic behind its last slash.
fn last_part(topic: &str) -> &str {
    topic.rsplit('/').next().unwrap_or(topic)
}

/// The name of a topic before its last slash.
fn namespace(topic: &str) -> &str {
    topic.rsplit_once('/').map_or("", |(space, _)| space)
}
