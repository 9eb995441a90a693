//! The first error of the operating system while a file is written.
//!
//! Encoders wrap such errors in their own, or replace them, so that a full disk would look like a
//! fault of the encoder.

use std::io::{self, Seek, Write};

/// A writer that keeps the first error of the operating system.
#[derive(Debug)]
pub struct ErrorKeeper<W> {
    pub(super) writer: W,
    pub(super) error: Option<io::Error>,
}

impl<W> ErrorKeeper<W> {
    /// Wraps a writer.
    pub(super) fn new(writer: W) -> Self {
        Self {
            writer,
            error: None,
        }
    }

    fn keep<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        result.inspect_err(|error| {
            // Interrupted writes are repeated.
            if error.kind() != io::ErrorKind::Interrupted {
                let copy = || match error.raw_os_error() {
                    Some(code) => io::Error::from_raw_os_error(code),
                    None => io::Error::new(error.kind(), error.to_string()),
                };
                self.error.get_or_insert_with(copy);
            }
        })
    }
}

impl<W: Write> Write for ErrorKeeper<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.writer.write(bytes);
        self.keep(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.writer.flush();
        self.keep(flushed)
    }
}

impl<W: Seek> Seek for ErrorKeeper<W> {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        let place = self.writer.seek(to);
        self.keep(place)
    }
}
