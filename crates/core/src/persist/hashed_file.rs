//! Files that end with the BLAKE3 hash of their content, so that damage shows.

use super::atomic::{self, WriteError};
use std::io::{self, BufWriter, ErrorKind, IntoInnerError, Write};
use std::path::Path;
use tunnelstitch_geometry::files::read_regular;

/// Buffer size of the hasher, bytes.
const HASH_BUFFER_BYTES: usize = 1 << 17;
/// Largest file, bytes.
const MAX_BYTES: u64 = 16 << 30;

/// Reads the content of a file, without the hash; None if the file is missing.
///
/// # Errors
/// An error of the operating system; one of the kind [`ErrorKind::InvalidData`] if the hash does
/// not match.
pub(super) fn read(path: &Path) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = match read_regular(path, MAX_BYTES) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    match bytes.split_last_chunk() {
        Some((content, hash)) if blake3::hash(content) == blake3::Hash::from(*hash) => {
            bytes.truncate(content.len());
            Ok(Some(bytes))
        }
        _ => Err(io::Error::new(
            ErrorKind::InvalidData,
            "its hash does not match",
        )),
    }
}

/// Writes a file, ended by the hash of its content.
///
/// # Errors
/// An error of the operating system, or of `content`.
pub(super) fn write(
    path: &Path,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    atomic::write(path, |writer| {
        let hashing = Hashing {
            writer,
            hasher: blake3::Hasher::new(),
        };
        // Buffered, because hashing number by number is slow.
        let mut hashing = BufWriter::with_capacity(HASH_BUFFER_BYTES, hashing);
        content(&mut hashing)?;
        let Hashing { writer, hasher } =
            hashing.into_inner().map_err(IntoInnerError::into_error)?;
        writer.write_all(hasher.finalize().as_bytes())
    })
}

/// A writer that hashes its data.
struct Hashing<'a, W> {
    writer: &'a mut W,
    hasher: blake3::Hasher,
}

impl<W: Write> Write for Hashing<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.writer.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}
