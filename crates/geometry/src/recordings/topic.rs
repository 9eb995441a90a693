//! Topics of a recording: their names, and the kinds of their messages.

use super::fields::Fields;
use super::place::Place;

/// The serialisation of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wire {
    /// That of ROS 1.
    Ros1,
    /// CDR, that of ROS 2.
    Cdr,
}

impl Wire {
    /// The fields of a message.
    ///
    /// # Errors
    /// The errors of [`Fields::cdr`].
    pub fn fields(self, message: &[u8]) -> Result<Fields<'_>, String> {
        match self {
            Self::Ros1 => Ok(Fields::packed(message)),
            Self::Cdr => Fields::cdr(message),
        }
    }
}

/// The kinds of messages that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageKind {
    /// `sensor_msgs/Image`.
    Image,
    /// `sensor_msgs/CompressedImage`.
    CompressedImage,
    /// `sensor_msgs/CameraInfo`.
    CameraInfo,
    /// `nav_msgs/Odometry`.
    Odometry,
    /// `geometry_msgs/PoseStamped`.
    PoseStamped,
    /// `geometry_msgs/PoseWithCovarianceStamped`.
    PoseWithCovarianceStamped,
    /// `tf2_msgs/TFMessage`.
    Transforms,
}

impl MessageKind {
    /// The kind of a type; None for all others. ROS 2 writes `sensor_msgs/msg/Image`, ROS 1
    /// `sensor_msgs/Image`.
    pub fn of(message_type: &str) -> Option<Self> {
        Some(match message_type.replacen("/msg/", "/", 1).as_str() {
            "sensor_msgs/Image" => Self::Image,
            "sensor_msgs/CompressedImage" => Self::CompressedImage,
            "sensor_msgs/CameraInfo" => Self::CameraInfo,
            "nav_msgs/Odometry" => Self::Odometry,
            "geometry_msgs/PoseStamped" => Self::PoseStamped,
            "geometry_msgs/PoseWithCovarianceStamped" => Self::PoseWithCovarianceStamped,
            "tf2_msgs/TFMessage" | "tf/tfMessage" => Self::Transforms,
            _ => return None,
        })
    }

    /// True if a message begins with a header.
    pub fn has_header(self) -> bool {
        self != Self::Transforms
    }
}

/// Kinds of messages that serve one purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopicGroup {
    /// Images, compressed or not.
    Images,
    /// Poses of all kinds.
    Poses,
    /// Calibrations.
    Calibrations,
}

impl TopicGroup {
    /// True if a kind belongs to the group.
    pub fn has(self, kind: MessageKind) -> bool {
        use MessageKind::{CameraInfo, CompressedImage, Image};
        match self {
            Self::Images => matches!(kind, Image | CompressedImage),
            Self::Calibrations => kind == CameraInfo,
            Self::Poses => !matches!(kind, Image | CompressedImage | CameraInfo),
        }
    }

    /// The name for messages, with the types.
    pub(super) fn description(self) -> &'static str {
        match self {
            Self::Images => "images (sensor_msgs Image, CompressedImage)",
            Self::Poses => {
                "poses (nav_msgs Odometry, geometry_msgs PoseStamped and \
                 PoseWithCovarianceStamped, tf2_msgs TFMessage)"
            }
            Self::Calibrations => "calibrations (sensor_msgs CameraInfo)",
        }
    }

    /// The key of `survey.toml` that names a topic.
    pub(super) fn key(self) -> &'static str {
        match self {
            Self::Images => "`topic` under [frames]",
            Self::Poses => "`topic` under [poses]",
            Self::Calibrations => "`name` under [camera]",
        }
    }
}

/// A topic with the places of its messages.
#[derive(Clone, Debug)]
pub struct Topic {
    /// The name.
    pub name: String,
    /// The type of its messages.
    pub message_type: String,
    /// The kind and serialisation of its messages, if they are read.
    pub content: Option<(MessageKind, Wire)>,
    /// Number of messages.
    pub count: usize,
    /// The places of messages that are read, in the order of the file.
    pub messages: Vec<Message>,
}

impl Topic {
    /// True if its messages are of a group.
    pub fn is_of(&self, group: TopicGroup) -> bool {
        self.content.is_some_and(|(kind, _)| group.has(kind))
    }
}

/// A message: its place and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message {
    /// The place of its bytes.
    pub place: Place,
    /// The time of its header, seconds, if it has one.
    pub time_s: Option<f64>,
}
