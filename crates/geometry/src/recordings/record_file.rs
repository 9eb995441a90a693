//! The file of a recording, read record by record.

use super::chunk::MAX_CHUNK_BYTES;
use super::error::RecordingError;
use crate::files::open_regular;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// A recording that is read from its start to its end.
pub struct RecordFile {
    path: PathBuf,
    reader: BufReader<File>,
    at: u64,
    size: u64,
    /// The remedy for a file that is cut off or damaged.
    remedy: &'static str,
}

impl RecordFile {
    /// Opens a regular file.
    ///
    /// # Errors
    /// An unreadable file.
    pub fn open(path: &Path, remedy: &'static str) -> Result<Self, RecordingError> {
        let unreadable = |source| RecordingError::unreadable(path, source);
        let file = open_regular(path).map_err(unreadable)?;
        Ok(Self {
            path: path.to_owned(),
            size: file.metadata().map_err(unreadable)?.len(),
            reader: BufReader::new(file),
            at: 0,
            remedy,
        })
    }

    /// Position of the next byte.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// True at the end.
    pub fn is_at_end(&self) -> bool {
        self.at >= self.size
    }

    /// Reads bytes.
    ///
    /// # Errors
    /// More than there are, or than a chunk may have; an error of the operating system.
    pub fn bytes(&mut self, count: u64) -> Result<Vec<u8>, RecordingError> {
        self.check_room(count)?;
        if count > MAX_CHUNK_BYTES {
            return Err(self.damaged(format!(
                "a record of {count} bytes, more than the {MAX_CHUNK_BYTES} that are read"
            )));
        }
        let mut bytes = Vec::new();
        let read = (&mut self.reader).take(count).read_to_end(&mut bytes);
        read.map_err(|source| RecordingError::unreadable(&self.path, source))?;
        if bytes.len() as u64 != count {
            return Err(self.cut_off());
        }
        self.at += count;
        Ok(bytes)
    }

    /// Reads N bytes.
    ///
    /// # Errors
    /// Fewer bytes; an error of the operating system.
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], RecordingError> {
        self.check_room(N as u64)?;
        let mut bytes = [0; N];
        match self.reader.read_exact(&mut bytes) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Err(self.cut_off()),
            Err(source) => return Err(RecordingError::unreadable(&self.path, source)),
        }
        self.at += N as u64;
        Ok(bytes)
    }

    /// Skips bytes.
    ///
    /// # Errors
    /// Fewer bytes; an error of the operating system.
    pub fn skip(&mut self, count: u64) -> Result<(), RecordingError> {
        self.check_room(count)?;
        let step = i64::try_from(count).map_err(|_| self.cut_off())?;
        let skipped = self.reader.seek_relative(step);
        skipped.map_err(|source| RecordingError::unreadable(&self.path, source))?;
        self.at += count;
        Ok(())
    }

    /// The error of damaged content before the next byte, with the remedy.
    pub fn damaged(&self, what: impl std::fmt::Display) -> RecordingError {
        let what = format!("before byte {}: {what}; {}", self.at, self.remedy);
        RecordingError::content(&self.path, what)
    }

    /// The error of a file that ends too early.
    pub fn cut_off(&self) -> RecordingError {
        let (size, remedy) = (self.size, self.remedy);
        let what = format!("is cut off after {size} bytes; {remedy}");
        RecordingError::content(&self.path, what)
    }

    fn check_room(&self, count: u64) -> Result<(), RecordingError> {
        // The size counts, and not the file, which may grow.
        if count > self.size.saturating_sub(self.at) {
            return Err(self.cut_off());
        }
        Ok(())
    }
}
