//! Places of chunks and messages in a recording.

use super::chunk::Compression;

/// A chunk: messages that are packed together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Position of its packed bytes in the file.
    pub position: u64,
    /// Number of its packed bytes.
    pub bytes: usize,
    /// Number of its bytes when unpacked.
    pub unpacked_bytes: usize,
    /// The way it is packed.
    pub compression: Compression,
}

impl Chunk {
    /// The place of what begins at `at` in the unpacked chunk, which has this number in the index.
    pub(super) fn origin(&self, number: usize, at: usize) -> Origin {
        match self.compression {
            Compression::None => Origin::File(self.position + at as u64),
            _ => Origin::Chunk { chunk: number, at },
        }
    }
}

/// The place of a message's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the file itself.
    File {
        /// Position in the file.
        position: u64,
        /// Number of bytes.
        bytes: usize,
    },
    /// In a chunk that is to be unpacked.
    Chunk {
        /// Number of the chunk in the index.
        chunk: usize,
        /// Position in the unpacked chunk.
        at: usize,
        /// Number of bytes.
        bytes: usize,
    },
}

/// The place where the content of a record begins.
#[derive(Clone, Copy)]
pub(super) enum Origin {
    /// In the file itself, at a position.
    File(u64),
    /// In a chunk that is to be unpacked: its number in the index, and a position in it.
    Chunk { chunk: usize, at: usize },
}

impl Origin {
    /// The place of `bytes` bytes, `skipped` bytes after the origin.
    pub(super) fn place(self, skipped: usize, bytes: usize) -> Place {
        match self {
            Self::File(position) => Place::File {
                position: position + skipped as u64,
                bytes,
            },
            Self::Chunk { chunk, at } => Place::Chunk {
                chunk,
                at: at + skipped,
                bytes,
            },
        }
    }
}
