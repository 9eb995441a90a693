//! The decoders of picture files, chosen by what the files hold.

use super::tiff_stack::PageFile;
use image::{ImageDecoder, ImageFormat, ImageReader, ImageResult, Limits};
use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use std::rc::Rc;
use tunnelstitch_geometry::files::open_regular;
use tunnelstitch_geometry::files::regular::read_limited_into;

/// Memory for what a PNG file holds beside its pixels, and for one row of them, bytes: a colour
/// profile of 1 MB can inflate to 1 GiB. A larger profile is skipped; none is used.
const MAX_PNG_METADATA_BYTES: u64 = 16 << 20;
/// Largest size of a picture file, bytes for a pixel: four channels of 32 bits, uncompressed.
const MAX_BYTES_PER_PIXEL: u64 = 16;
/// Largest size of what a picture file holds beside its pixels, bytes.
const MAX_METADATA_BYTES: u64 = 64 << 20;

/// Opens a picture file and reads its header only.
///
/// # Errors
/// A missing file, or one that is no picture.
pub fn open_picture(path: &Path) -> ImageResult<impl ImageDecoder + use<>> {
    decoder(open_input(path)?)
}

/// The input of a file, from its start.
///
/// # Errors
/// A missing file, or what is no regular one.
pub(super) fn open_input(path: &Path) -> io::Result<Input> {
    Ok(Input::File(BufReader::new(open_regular(path)?)))
}

/// The decoder for what an input holds, after reading its header.
pub(super) fn decoder(input: Input) -> ImageResult<impl ImageDecoder> {
    let mut reader = ImageReader::new(input).with_guessed_format()?;
    if reader.format() == Some(ImageFormat::Png) {
        let mut limits = Limits::default();
        limits.max_alloc = Some(MAX_PNG_METADATA_BYTES);
        reader.limits(limits);
    }
    reader.into_decoder()
}

/// Input of a decoder. It is one type, so that every decoder is compiled once.
pub(super) enum Input {
    /// A file, as far as it is asked for.
    File(BufReader<File>),
    /// The content of a file.
    Content(Cursor<Content>),
    /// A page of a TIFF file.
    Page(BufReader<PageFile>),
}

impl Read for Input {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::Content(content) => content.read(buffer),
            Self::Page(page) => page.read(buffer),
        }
    }
}

impl BufRead for Input {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        match self {
            Self::File(file) => file.fill_buf(),
            Self::Content(content) => content.fill_buf(),
            Self::Page(page) => page.fill_buf(),
        }
    }

    fn consume(&mut self, bytes: usize) {
        match self {
            Self::File(file) => file.consume(bytes),
            Self::Content(content) => content.consume(bytes),
            Self::Page(page) => page.consume(bytes),
        }
    }
}

impl Seek for Input {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::Content(content) => content.seek(to),
            Self::Page(page) => page.seek(to),
        }
    }
}

/// The content of a file, shared by all who read it.
#[derive(Clone)]
pub(super) struct Content(Rc<Buffer>);

impl Content {
    /// Reads the file of a picture of `width` × `height` pixels.
    ///
    /// # Errors
    /// An error of the operating system; what is no regular file, or larger than such a picture.
    pub fn of(path: &Path, width: u32, height: u32) -> io::Result<Self> {
        let pixels = u64::from(width) * u64::from(height);
        let mut buffer = Buffer(ROOM.take());
        buffer.0.clear();
        let file = open_regular(path)?;
        read_limited_into(
            &file,
            MAX_BYTES_PER_PIXEL * pixels + MAX_METADATA_BYTES,
            &mut buffer.0,
        )?;
        Ok(Self(Rc::new(buffer)))
    }

    /// The content of a file that is a part of another.
    pub fn copied(bytes: &[u8]) -> Self {
        let mut buffer = Buffer(ROOM.take());
        buffer.0.clear();
        buffer.0.extend_from_slice(bytes);
        Self(Rc::new(buffer))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A grey PNG file whose colour profile inflates to `profile_bytes` zeros.
    fn png_with_profile(path: &Path, profile_bytes: usize) {
        let mut plain = Cursor::new(Vec::new());
        let picture = image::GrayImage::from_pixel(8, 4, image::Luma([77]));
        picture.write_to(&mut plain, ImageFormat::Png).unwrap();
        let plain = plain.into_inner();
        let profile = miniz_oxide::deflate::compress_to_vec_zlib(&vec![0; profile_bytes], 9);
        let content = [b"iCCPp\0\0", &profile[..]].concat();
        let length = (content.len() - 4) as u32;
        let chunk = [
            &length.to_be_bytes()[..],
            &content,
            &crc32(&content).to_be_bytes(),
        ]
        .concat();
        // After the signature and IHDR.
        let (head, rest) = plain.split_at(8 + 25);
        std::fs::write(path, [head, &chunk, rest].concat()).unwrap();
    }

    /// CRC-32 of a chunk, bit by bit (PNG specification, annex D).
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |crc: u32, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                (crc >> 1) ^ (0xedb8_8320 * (crc & 1))
            })
        })
    }

    #[test]
    fn large_colour_profiles_are_skipped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.png");
        for (bytes, is_kept) in [(1 << 12, true), (40 << 20, false)] {
            png_with_profile(&path, bytes);
            let mut decoder = open_picture(&path).unwrap();
            assert_eq!(decoder.icc_profile().unwrap().is_some(), is_kept);
            let picture = image::DynamicImage::from_decoder(decoder).unwrap();
            assert_eq!(picture.into_luma8().get_pixel(7, 3).0, [77]);
        }
    }
}
