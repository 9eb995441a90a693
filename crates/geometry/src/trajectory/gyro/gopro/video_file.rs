//! The file of a video: its index, and bytes at places that the index names.

use super::boxes::{BoxHeader, MAX_HEADER_BYTES};
use crate::files::open_regular;
use crate::trajectory::error::PoseError;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Kinds of boxes that MP4 and QuickTime files begin with.
const FIRST_KINDS: [[u8; 4]; 6] = [*b"ftyp", *b"moov", *b"mdat", *b"wide", *b"free", *b"skip"];
/// Largest index, bytes: a day of 240 frames a second has 20 million frames, of less than 20 bytes
/// each, and GoPros begin a new file after 4 GB.
const MAX_INDEX_BYTES: u64 = 512 << 20;
/// Most boxes before the index; cameras write three.
const MAX_BOXES: usize = 1000;

/// An MP4 or QuickTime file.
pub struct VideoFile {
    path: PathBuf,
    file: File,
    size: u64,
}

impl VideoFile {
    /// Opens a file; [`None`] if it begins otherwise than an MP4.
    ///
    /// # Errors
    /// An unreadable file.
    pub fn open(path: &Path) -> Result<Option<Self>, PoseError> {
        let unreadable = |source| PoseError::Read {
            path: path.to_owned(),
            source,
        };
        let file = open_regular(path).map_err(unreadable)?;
        let mut start = Vec::new();
        let read = (&file).take(8).read_to_end(&mut start);
        read.map_err(unreadable)?;
        let is_video = FIRST_KINDS
            .iter()
            .any(|kind| start.get(4..) == Some(&kind[..]));
        Ok(is_video.then_some(Self {
            path: path.to_owned(),
            size: file.metadata().map_err(unreadable)?.len(),
            file,
        }))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Size, bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Reads the content of the box `moov`.
    ///
    /// # Errors
    /// A file without it, or in which it is damaged or too large; an error of the operating system.
    pub fn index(&mut self) -> Result<Vec<u8>, PoseError> {
        let mut at = 0;
        for _ in 0..MAX_BOXES {
            let room = self.size - at;
            if room < 8 {
                break;
            }
            let start = self.bytes(at, room.min(MAX_HEADER_BYTES))?;
            let header = BoxHeader::parse(&start, room).map_err(|what| self.error(what))?;
            if header.kind == *b"moov" {
                let bytes = header.bytes - header.header_bytes;
                if bytes > MAX_INDEX_BYTES {
                    return Err(self.error(format!("its index has {bytes} bytes; it is damaged")));
                }
                return self.bytes(at + header.header_bytes, bytes);
            }
            at += header.bytes;
        }
        Err(self.error(
            "has no index (box `moov`), as if its recording or copying was broken off; copy it \
             again, or let the camera repair it",
        ))
    }

    /// Reads bytes at a position.
    ///
    /// # Errors
    /// Fewer bytes; an error of the operating system.
    pub fn bytes(&mut self, position: u64, count: u64) -> Result<Vec<u8>, PoseError> {
        if count > self.size.saturating_sub(position) {
            return Err(self.cut_off(position));
        }
        let unreadable = |source| PoseError::Read {
            path: self.path.clone(),
            source,
        };
        let mut bytes = vec![0; count as usize];
        let sought = self.file.seek(SeekFrom::Start(position));
        match sought.and_then(|_| self.file.read_exact(&mut bytes)) {
            Ok(()) => Ok(bytes),
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => Err(self.cut_off(position)),
            Err(error) => Err(unreadable(error)),
        }
    }

    /// An error of the content.
    pub fn error(&self, what: impl Into<String>) -> PoseError {
        PoseError::file(&self.path, what)
    }

    fn cut_off(&self, position: u64) -> PoseError {
        self.error(format!(
            "is cut off after {} bytes: its index names bytes from {position} on",
            self.size
        ))
    }
}
