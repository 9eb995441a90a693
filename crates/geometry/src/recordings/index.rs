//! The index of a recording while it is read: channels, topics and the places of messages.

use super::place::{Chunk, Place};
use super::stamp::Header;
use super::topic::{Message, MessageKind, Topic, TopicGroup, Wire};
use std::collections::HashMap;

/// Largest number of messages that are read, each of which takes 48 bytes of memory: those of a
/// sensor that sends a thousand in a second for three hours.
const MAX_MESSAGES: usize = 10_800_000;
/// Largest number of topics; robots have hundreds.
const MAX_TOPICS: usize = 4096;

/// The topics and chunks of a recording.
#[derive(Debug, Default)]
pub struct Index {
    /// The topics, in the order of the file.
    pub topics: Vec<Topic>,
    /// The chunks with messages that are read.
    pub chunks: Vec<Chunk>,
    /// The topic of each channel.
    channels: HashMap<u32, usize>,
    messages: usize,
}

impl Index {
    /// True if a topic of a group and name has a message.
    pub fn has_message(&self, group: TopicGroup, name: &str) -> bool {
        let mut topics = self.topics.iter();
        topics.any(|topic| topic.count > 0 && topic.name == name && topic.is_of(group))
    }

    /// Adds a channel, which is a source of a topic's messages; `wire` is their serialisation, if
    /// it is read.
    ///
    /// # Errors
    /// More topics than a robot has, in words.
    pub fn add_channel(
        &mut self,
        id: u32,
        name: &str,
        message_type: &str,
        wire: Option<Wire>,
    ) -> Result<(), String> {
        let content = MessageKind::of(message_type).zip(wire);
        let is_same = |topic: &Topic| {
            topic.name == name && topic.message_type == message_type && topic.content == content
        };
        let stated = self.channels.get(&id).map(|topic| &self.topics[*topic]);
        if stated.is_some_and(is_same) {
            // Every chunk may state its channels.
            return Ok(());
        }
        let topic = match self.topics.iter().position(is_same) {
            Some(topic) => topic,
            None if self.topics.len() == MAX_TOPICS => {
                return Err(format!("more than {MAX_TOPICS} topics"));
            }
            None => {
                self.topics.push(Topic {
                    name: name.to_owned(),
                    message_type: message_type.to_owned(),
                    content,
                    count: 0,
                    messages: Vec::new(),
                });
                self.topics.len() - 1
            }
        };
        self.channels.insert(id, topic);
        Ok(())
    }

    /// Adds a message of a channel.
    ///
    /// # Errors
    /// A channel that is not there; a header that cannot be read, in words.
    pub fn add_message(&mut self, channel: u32, place: Place, bytes: &[u8]) -> Result<(), String> {
        let Some(topic) = self.channels.get(&channel) else {
            return Err(format!(
                "a message of channel {channel}, which is not there"
            ));
        };
        let topic = &mut self.topics[*topic];
        topic.count += 1;
        let Some((kind, wire)) = topic.content else {
            return Ok(());
        };
        self.messages += 1;
        if self.messages > MAX_MESSAGES {
            return Err(format!(
                "more than {MAX_MESSAGES} messages of images, poses and calibrations"
            ));
        }
        let time_s = match kind.has_header() {
            true => Some(time_of(bytes, wire).map_err(|what| {
                format!("topic {}, message {}: {what}", topic.name, topic.count - 1)
            })?),
            false => None,
        };
        topic.messages.push(Message { place, time_s });
        Ok(())
    }
}

/// The time of a message's header, seconds.
fn time_of(message: &[u8], wire: Wire) -> Result<f64, String> {
    Ok(Header::read(&mut wire.fields(message)?, wire)?.time_s)
}
