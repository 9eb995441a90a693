//! The decoders of picture files, chosen by what the files hold.

use image::{ImageDecoder, ImageReader, ImageResult};
use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use std::rc::Rc;

/// Opens a picture file and reads its header only.
///
/// # Errors
/// A missing file, or one that is no picture.
pub fn open_picture(path: &Path) -> ImageResult<impl ImageDecoder + use<>> {
    decoder(Input::File(BufReader::new(File::open(path)?)))
}

/// The decoder for what an input holds, after reading its header.
pub(super) fn decoder(input: Input) -> ImageResult<impl ImageDecoder> {
    ImageReader::new(input)
        .with_guessed_format()?
        .into_decoder()
}

/// Input of a decoder. It is one type, so that every decoder is compiled once.
pub(super) enum Input {
    /// A file, as far as it is asked for.
    File(BufReader<File>),
    /// The content of a file.
    Content(Cursor<Content>),
}

impl Read for Input {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::Content(content) => content.read(buffer),
        }
    }
}

impl BufRead for Input {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        match self {
            Self::File(file) => file.fill_buf(),
            Self::Content(content) => content.fill_buf(),
        }
    }

    fn consume(&mut self, bytes: usize) {
        match self {
            Self::File(file) => file.consume(bytes),
            Self::Content(content) => content.consume(bytes),
        }
    }
}

impl Seek for Input {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::Content(content) => content.seek(to),
        }
    }
}

/// The content of a file, shared by all who read it.
#[derive(Clone)]
pub(super) struct Content(Rc<Buffer>);

impl Content {
    /// Reads a file.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn of(path: &Path) -> io::Result<Self> {
        let mut buffer = Buffer(ROOM.take());
        buffer.0.clear();
        File::open(path)?.read_to_end(&mut buffer.0)?;
        Ok(Self(Rc::new(buffer)))
    }

    /// An input for a decoder, from the content's start.
    pub fn input(&self) -> Input {
        Input::Content(Cursor::new(self.clone()))
    }
}

impl AsRef<[u8]> for Content {
    fn as_ref(&self) -> &[u8] {
        &self.0.0
    }
}

/// A buffer that is reused for the thread's next file, because allocating zeroed memory costs as
/// much as reading.
struct Buffer(Vec<u8>);

thread_local! {
    static ROOM: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // The buffer is dropped if the thread is ending.
        let _ = ROOM.try_with(|room| room.replace(std::mem::take(&mut self.0)));
    }
}
