//! Recordings written by hand: the messages of a survey as ROS serialises them, in MCAP and in bags
//! of ROS 1.
//!
//! Nothing here is shared with the readers.

use image::DynamicImage;
use std::path::Path;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::Pose;

/// The serialisation of messages.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Wire {
    Ros1,
    Ros2,
}

/// A message with its topic and type.
pub struct Message {
    pub topic: &'static str,
    pub kind: &'static str,
    pub time_s: f64,
    pub bytes: Vec<u8>,
}

/// Fields of a message; those of ROS 2 lie at multiples of their size.
pub struct Fields(Wire, Vec<u8>);

impl Fields {
    fn number(mut self, bytes: &[u8]) -> Self {
        while self.0 == Wire::Ros2 && !self.1.len().is_multiple_of(bytes.len()) {
            self.1.push(0);
        }
        self.1.extend(bytes);
        self
    }

    pub fn u8(self, value: u8) -> Self {
        self.number(&[value])
    }

    pub fn u32(self, value: u32) -> Self {
        self.number(&value.to_le_bytes())
    }

    pub fn f64s(self, values: &[f64]) -> Self {
        let each = values.iter();
        each.fold(self, |fields, value| fields.number(&value.to_le_bytes()))
    }

    pub fn bytes(self, bytes: &[u8]) -> Self {
        let mut fields = self.u32(bytes.len() as u32);
        fields.1.extend(bytes);
        fields
    }

    pub fn text(self, text: &str) -> Self {
        match self.0 {
            Wire::Ros1 => self.bytes(text.as_bytes()),
            Wire::Ros2 => self.bytes(format!("{text}\0").as_bytes()),
        }
    }

    /// A message that begins with a header.
    pub fn stamped(wire: Wire, time_s: f64) -> Self {
        Self(wire, Vec::new()).header(time_s, "camera")
    }

    fn header(self, time_s: f64, frame: &str) -> Self {
        let fields = match self.0 {
            Wire::Ros1 => self.u32(0),
            Wire::Ros2 => self,
        };
        let nanoseconds = (time_s.fract() * 1e9).round() as u32;
        fields.u32(time_s as u32).u32(nanoseconds).text(frame)
    }

    pub fn into_bytes(self) -> Vec<u8> {
        match self.0 {
            Wire::Ros1 => self.1,
            Wire::Ros2 => [&[0, 1, 0, 0], &self.1[..]].concat(),
        }
    }
}

/// An image as `sensor_msgs/Image`.
pub fn image(wire: Wire, time_s: f64, picture: &DynamicImage, encoding: &str) -> Message {
    let (width, height) = (picture.width(), picture.height());
    let step = picture.as_bytes().len() as u32 / height;
    let fields = Fields::stamped(wire, time_s).u32(height).u32(width);
    let fields = fields.text(encoding).u8(0).u32(step);
    Message {
        topic: "/camera/image_raw",
        kind: "sensor_msgs/Image",
        time_s,
        bytes: fields.bytes(picture.as_bytes()).into_bytes(),
    }
}

/// A picture file as `sensor_msgs/CompressedImage`.
pub fn compressed(wire: Wire, time_s: f64, file: &[u8]) -> Message {
    let fields = Fields::stamped(wire, time_s).text("jpeg").bytes(file);
    Message {
        topic: "/camera/image_raw/compressed",
        kind: "sensor_msgs/CompressedImage",
        time_s,
        bytes: fields.into_bytes(),
    }
}

/// A pose as `nav_msgs/Odometry`: position, then the quaternion x y z w.
fn odometry(wire: Wire, time_s: f64, pose: &[f64; 7]) -> Message {
    let fields = Fields::stamped(wire, time_s).text("camera").f64s(pose);
    Message {
        topic: "/odom",
        kind: "nav_msgs/Odometry",
        time_s,
        // Covariance, twist, covariance.
        bytes: fields.f64s(&[0.0; 36 + 6 + 36]).into_bytes(),
    }
}

/// A transform from the child's frame to the parent's as `tf2_msgs/TFMessage`.
pub fn transform(
    wire: Wire,
    topic: &'static str,
    time_s: f64,
    [parent, child]: [&str; 2],
    pose: &Pose,
) -> Message {
    let [x, y, z, w] = pose.r_wc.coords.into();
    let t = pose.t_wc;
    let fields = Fields(wire, Vec::new()).u32(1).header(time_s, parent);
    let fields = fields.text(child).f64s(&[t.x, t.y, t.z, x, y, z, w]);
    Message {
        topic,
        kind: "tf2_msgs/TFMessage",
        time_s,
        bytes: fields.into_bytes(),
    }
}

/// The calibration of a survey as `sensor_msgs/CameraInfo`.
fn camera_info(wire: Wire, survey: &Survey) -> Message {
    let camera = survey.cameras.of(0);
    let fields = Fields::stamped(wire, 0.0).u32(camera.height);
    let fields = fields.u32(camera.width).text("plumb_bob");
    let fields = fields.u32(5).f64s(&[0.0; 5]);
    let k = [
        camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0,
    ];
    let fields = fields.f64s(&k).f64s(&[0.0; 9 + 12]);
    // Binning, and the region of interest.
    let fields = (0..6).fold(fields, |fields, _| fields.u32(0)).u8(0);
    Message {
        topic: "/camera/camera_info",
        kind: "sensor_msgs/CameraInfo",
        time_s: 0.0,
        bytes: fields.into_bytes(),
    }
}

/// All messages of a survey whose frames are grey.
pub fn messages_of(survey: &Survey, wire: Wire) -> Vec<Message> {
    let mut messages = vec![camera_info(wire, survey)];
    for (frame, stamped) in survey.frames.iter().zip(&survey.initial) {
        let time_s = stamped.time_s;
        let [x, y, z, w] = stamped.pose.r_wc.coords.into();
        let t = stamped.pose.t_wc;
        messages.push(odometry(wire, time_s, &[t.x, t.y, t.z, x, y, z, w]));
        let picture = image::open(&frame.path).expect("a frame");
        messages.push(image(wire, time_s, &picture, "mono8"));
    }
    messages
}

/// Writes an MCAP file of chunks of a few messages.
pub fn write_mcap(path: &Path, wire: Wire, messages: &[Message]) {
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    let encoding = match wire {
        Wire::Ros1 => "ros1",
        Wire::Ros2 => "cdr",
    };
    let mut file = MAGIC.to_vec();
    file.extend(record(1, &[text("ros"), text("by hand")].concat()));
    let topics = topics(messages);
    for messages in messages.chunks(5) {
        let mut records = Vec::new();
        for message in messages {
            let id = topics
                .iter()
                .position(|topic| *topic == message.topic)
                .unwrap() as u16
                + 1;
            let id = id.to_le_bytes();
            let kind = match wire {
                Wire::Ros1 => message.kind.to_owned(),
                Wire::Ros2 => message.kind.replace('/', "/msg/"),
            };
            let schema = [&id[..], &text(&kind), &text("ros2msg"), &[0; 4]].concat();
            records.extend(record(3, &schema));
            let channel = [&id[..], &id, &text(message.topic), &text(encoding), &[0; 4]].concat();
            records.extend(record(4, &channel));
            records.extend(record(5, &[&id[..], &[0; 20], &message.bytes].concat()));
        }
        let mut chunk = vec![0; 16];
        chunk.extend((records.len() as u64).to_le_bytes());
        // No check sum.
        chunk.extend([&[0; 4][..], &text("")].concat());
        chunk.extend((records.len() as u64).to_le_bytes());
        chunk.extend(records);
        file.extend(record(6, &chunk));
    }
    // The end of the data, and a footer without a summary.
    file.extend(record(15, &[0; 4]));
    file.extend(record(2, &[0; 20]));
    file.extend(MAGIC);
    std::fs::write(path, file).expect("a recording");
}

/// Writes a bag of ROS 1 with chunks of a few messages.
pub fn write_bag(path: &Path, messages: &[Message]) {
    let topics = topics(messages);
    let chunks: Vec<_> = messages.chunks(5).collect();
    let mut file = b"#ROSBAG V2.0\n".to_vec();
    let count = (chunks.len() as u32).to_le_bytes();
    let header: [(&str, &[u8]); 4] = [
        ("op", &[3]),
        ("index_pos", &[0; 8]),
        ("conn_count", &[topics.len() as u8, 0, 0, 0]),
        ("chunk_count", &count),
    ];
    file.extend(bag_record(&header, &[b' '; 4027]));
    for messages in chunks {
        let mut records = Vec::new();
        for message in messages {
            let id = topics
                .iter()
                .position(|topic| *topic == message.topic)
                .unwrap() as u32;
            let (id, topic) = (id.to_le_bytes(), message.topic.as_bytes());
            let data = [
                bag_field("topic", topic),
                bag_field("type", message.kind.as_bytes()),
            ];
            let connection: [(&str, &[u8]); 3] = [("op", &[7]), ("conn", &id), ("topic", topic)];
            records.extend(bag_record(&connection, &data.concat()));
            let header: [(&str, &[u8]); 3] = [("op", &[2]), ("conn", &id), ("time", &[0; 8])];
            records.extend(bag_record(&header, &message.bytes));
        }
        let size = (records.len() as u32).to_le_bytes();
        let header: [(&str, &[u8]); 3] = [("op", &[5]), ("compression", b"none"), ("size", &size)];
        file.extend(bag_record(&header, &records));
    }
    std::fs::write(path, file).expect("a bag");
}

fn bag_record(header: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let fields: Vec<Vec<u8>> = header
        .iter()
        .map(|(name, value)| bag_field(name, value))
        .collect();
    let (header, bytes) = (fields.concat(), (data.len() as u32).to_le_bytes());
    let length = (header.len() as u32).to_le_bytes();
    [&length[..], &header, &bytes, data].concat()
}

fn bag_field(name: &str, value: &[u8]) -> Vec<u8> {
    let length = (name.len() + 1 + value.len()) as u32;
    [&length.to_le_bytes()[..], name.as_bytes(), b"=", value].concat()
}

fn topics(messages: &[Message]) -> Vec<&'static str> {
    let mut topics: Vec<&str> = messages.iter().map(|message| message.topic).collect();
    topics.sort();
    topics.dedup();
    topics
}

fn record(opcode: u8, content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    [&[opcode][..], &length, content].concat()
}

fn text(text: &str) -> Vec<u8> {
    let length = (text.len() as u32).to_le_bytes();
    [&length[..], text.as_bytes()].concat()
}
