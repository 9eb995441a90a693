//! A recording: its topics, and the reading of their messages.

use super::error::RecordingError;
use super::index::Index;
use super::mcap;
use super::place::{Chunk, Place};
use super::rosbag;
use super::topic::{Message, Topic, TopicGroup};
use crate::files::open_regular;
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// True for a file whose name ends as those of recordings do.
pub fn is_recording(path: &Path) -> bool {
    ends_in(path, "mcap") || is_bag(path)
}

/// True for a file whose name ends as those of bags do.
fn is_bag(path: &Path) -> bool {
    ends_in(path, "bag")
}

/// True for a file of this extension, in whatever case.
fn ends_in(path: &Path, extension: &str) -> bool {
    (path.extension()).is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// A recording, whose messages are read from their places in the file.
#[derive(Clone, Debug)]
pub struct Recording {
    path: PathBuf,
    topics: Vec<Topic>,
    chunks: Vec<Chunk>,
}

impl Recording {
    /// Reads a recording from its start to its end, and keeps the places of its messages.
    ///
    /// # Errors
    /// An unreadable, damaged or cut-off file.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        Self::open_until(path, |_| false)
    }

    /// Reads a recording up to the first message of a topic, or to its end if the topic is not
    /// there.
    ///
    /// # Errors
    /// A file that cannot be read, or is damaged or cut off before.
    pub fn open_to_first(
        path: &Path,
        group: TopicGroup,
        topic: &str,
    ) -> Result<Self, RecordingError> {
        Self::open_until(path, |index| index.has_message(group, topic))
    }

    fn open_until(path: &Path, is_enough: impl Fn(&Index) -> bool) -> Result<Self, RecordingError> {
        let index = match is_bag(path) {
            true => rosbag::read_index(path, is_enough)?,
            false => mcap::read_index(path, is_enough)?,
        };
        let Index { topics, chunks, .. } = index;
        Ok(Self {
            path: path.to_owned(),
            topics,
            chunks,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The topics of a group that have messages.
    pub fn topics(&self, group: TopicGroup) -> impl Iterator<Item = &Topic> {
        let topics = self.topics.iter();
        topics.filter(move |topic| topic.count > 0 && topic.is_of(group))
    }

    /// The topic of a group with the given name, or the only one.
    ///
    /// # Errors
    /// No such topic, or several and no name; the error lists them with their counts.
    pub fn topic(&self, group: TopicGroup, name: Option<&str>) -> Result<&Topic, RecordingError> {
        let topics: Vec<&Topic> = self.topics(group).collect();
        let fail = |what: String| Err(RecordingError::content(&self.path, what));
        if topics.is_empty() {
            let others = self.topics.iter().filter(|topic| topic.count > 0);
            return fail(format!(
                "holds no {}; its topics: {}",
                group.description(),
                listed(others)
            ));
        }
        let chosen = match name {
            Some(name) => topics.iter().find(|topic| topic.name == name),
            None => topics.first().filter(|_| topics.len() == 1),
        };
        match (chosen, name) {
            (Some(topic), _) => Ok(topic),
            (None, Some(name)) => fail(format!(
                "holds no {} on topic {name:?}; it has {}",
                group.description(),
                listed(topics.into_iter())
            )),
            (None, None) => fail(format!(
                "has several topics of {}: {}; name one by {}",
                group.description(),
                listed(topics.into_iter()),
                group.key()
            )),
        }
    }

    /// A reader of the messages.
    ///
    /// # Errors
    /// A file that has become unreadable.
    pub fn reader(&self) -> Result<MessageReader<'_>, RecordingError> {
        let file = open_regular(&self.path);
        let file = file.map_err(|source| RecordingError::unreadable(&self.path, source))?;
        Ok(MessageReader {
            recording: self,
            file,
            unpacked: None,
        })
    }
}

/// Topics with their types and numbers of messages.
fn listed<'a>(topics: impl Iterator<Item = &'a Topic>) -> String {
    let line = |topic: &Topic| {
        let (name, kind, count) = (&topic.name, &topic.message_type, topic.count);
        format!("{name} ({kind}, {count} messages)")
    };
    let lines: Vec<String> = topics.map(line).collect();
    match lines.is_empty() {
        true => "none with a message".to_owned(),
        false => lines.join(", "),
    }
}

/// A reader of messages, which keeps the chunk of the last one.
pub struct MessageReader<'r> {
    recording: &'r Recording,
    file: File,
    /// Number and content of the chunk that was unpacked last.
    unpacked: Option<(usize, Vec<u8>)>,
}

impl MessageReader<'_> {
    /// Reads a message.
    ///
    /// # Errors
    /// A file that has changed since it was opened.
    pub fn read(&mut self, message: &Message) -> Result<Cow<'_, [u8]>, RecordingError> {
        let path = &self.recording.path;
        let changed = |what: String| {
            let what = format!("{what}; the file has changed since it was opened");
            RecordingError::content(path, what)
        };
        let unreadable = |source| RecordingError::unreadable(path, source);
        match message.place {
            Place::File { position, bytes } => {
                let bytes = read_at(&mut self.file, position, bytes).map_err(unreadable)?;
                Ok(Cow::Owned(bytes))
            }
            Place::Chunk { chunk, at, bytes } => {
                let kept = self.unpacked.take().filter(|(number, _)| *number == chunk);
                let unpacked = match kept {
                    Some((_, unpacked)) => unpacked,
                    None => {
                        let chunk = &self.recording.chunks[chunk];
                        let packed = read_at(&mut self.file, chunk.position, chunk.bytes)
                            .map_err(unreadable)?;
                        let unpacked = chunk.compression.unpack(&packed, chunk.unpacked_bytes);
                        unpacked.map_err(changed)?.into_owned()
                    }
                };
                let (_, unpacked) = self.unpacked.insert((chunk, unpacked));
                let bytes = unpacked.get(at..at.saturating_add(bytes));
                bytes.map(Cow::Borrowed).ok_or_else(|| {
                    let what = "a message is missing".to_owned();
                    RecordingError::content(path, what)
                })
            }
        }
    }
}

/// Reads bytes from a position.
fn read_at(file: &mut File, position: u64, count: usize) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(position))?;
    let mut bytes = Vec::new();
    file.take(count as u64).read_to_end(&mut bytes)?;
    if bytes.len() != count {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(bytes)
}
