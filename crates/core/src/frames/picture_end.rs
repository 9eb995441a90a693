//! Recognition of truncated picture files by their ends, without decoding them.

use super::picture_decoder::Input;
use super::tiff_stack::PageFile;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use tiff::tags::Tag;
use tunnelstitch_geometry::files::open_regular;

/// Bytes of the tail in which the end of a file is marked; padding after the mark is allowed.
const TAIL_BYTES: u64 = 4096;
/// The first bytes of a JPEG file, its marker SOI (ITU-T T.81, table B.1).
const JPEG_START: &[u8] = &[0xff, 0xd8];
/// The last bytes of a JPEG file, its marker EOI.
const JPEG_END: &[u8] = &[0xff, 0xd9];
/// The first bytes of a PNG file (PNG specification, section 5.2).
const PNG_START: &[u8] = b"\x89PNG\r\n\x1a\n";
/// The type of the last chunk of a PNG file and the check sum that follows (section 11.2.5).
const PNG_END: &[u8] = b"IEND\xae\x42\x60\x82";

/// True if the content of a JPEG file ends with its marker; the decoder silently fills missing
/// parts with grey.
pub(super) fn jpeg_is_complete(content: &[u8]) -> bool {
    let start = content.len().saturating_sub(TAIL_BYTES as usize);
    has_mark(&content[start..], JPEG_END)
}

/// True for the content of a JPEG file, or its start.
pub(super) fn is_jpeg(content: &[u8]) -> bool {
    content.starts_with(JPEG_START)
}

/// Finds out from a few bytes of a JPEG, PNG, TIFF or WebP file that it is truncated: the sentence
/// that says so. Files of other formats pass, as do those damaged before their end.
///
/// # Errors
/// An error of the operating system; what is no regular file.
pub(super) fn truncation(path: &Path) -> io::Result<Option<String>> {
    let mut file = open_regular(path)?;
    let bytes = file.metadata()?.len();
    let mut start = Vec::new();
    (&file).take(12).read_to_end(&mut start)?;
    let (format, is_whole) = if is_jpeg(&start) {
        ("JPEG", has_mark(&tail(&mut file, bytes)?, JPEG_END))
    } else if start.starts_with(PNG_START) {
        ("PNG", has_mark(&tail(&mut file, bytes)?, PNG_END))
    } else if start.starts_with(b"RIFF") && start.ends_with(b"WEBP") {
        ("WebP", bytes >= riff_bytes(&start))
    } else if start.starts_with(b"II") || start.starts_with(b"MM") {
        file.seek(SeekFrom::Start(0))?;
        let end = tiff_end(Input::File(BufReader::new(file)));
        ("TIFF", end.is_none_or(|end| bytes >= end))
    } else {
        return Ok(None);
    };
    Ok((!is_whole).then(|| truncated(format)))
}

/// Finds out that a TIFF file ends within the page whose directory is at `directory`, as
/// [`truncation`] does of whole files.
///
/// # Errors
/// An error of the operating system; what is no regular file.
pub(super) fn page_truncation(path: &Path, directory: u64) -> io::Result<Option<String>> {
    let page = PageFile::open(path, directory)?;
    let bytes = page.file_bytes()?;
    let end = tiff_end(Input::Page(BufReader::new(page)));
    let is_whole = end.is_none_or(|end| bytes >= end);
    Ok((!is_whole).then(|| truncated("TIFF")))
}

/// The sentence about a truncated file of a format.
pub(super) fn truncated(format: &str) -> String {
    format!("the {format} file is truncated")
}

fn has_mark(tail: &[u8], mark: &[u8]) -> bool {
    tail.windows(mark.len()).any(|window| window == mark)
}

/// The last bytes of a file.
fn tail(file: &mut File, bytes: u64) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(bytes.saturating_sub(TAIL_BYTES)))?;
    let mut tail = Vec::new();
    file.take(TAIL_BYTES).read_to_end(&mut tail)?;
    Ok(tail)
}

/// The size that a RIFF file states: its first chunk, with eight bytes before it.
fn riff_bytes(start: &[u8]) -> u64 {
    let size = start.get(4..8).and_then(|size| size.try_into().ok());
    size.map_or(0, |size| 8 + u64::from(u32::from_le_bytes(size)))
}

/// The end of the last strip or tile of a TIFF file's first picture; None where the decoder does
/// not understand it.
fn tiff_end(input: Input) -> Option<u64> {
    let mut decoder = tiff::decoder::Decoder::new(input).ok()?;
    let (offsets, sizes) = match decoder.find_tag(Tag::TileOffsets).ok()? {
        Some(_) => (Tag::TileOffsets, Tag::TileByteCounts),
        None => (Tag::StripOffsets, Tag::StripByteCounts),
    };
    let offsets = decoder.get_tag_u64_vec(offsets).ok()?;
    let sizes = decoder.get_tag_u64_vec(sizes).ok()?;
    let ends = offsets.iter().zip(&sizes);
    ends.map(|(offset, size)| offset.saturating_add(*size))
        .max()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageFormat, Luma};

    /// Every format is recognised as truncated when its last bytes are missing, and only then.
    #[test]
    fn a_file_without_its_end_is_truncated() {
        let picture = GrayImage::from_fn(64, 48, |u, v| Luma([(7 * u + 13 * v) as u8]));
        let dir = tempfile::tempdir().unwrap();
        let formats = [
            ("jpg", ImageFormat::Jpeg),
            ("png", ImageFormat::Png),
            ("tif", ImageFormat::Tiff),
            ("webp", ImageFormat::WebP),
        ];
        for (end, format) in formats {
            let path = dir.path().join(format!("frame.{end}"));
            let picture = image::DynamicImage::from(picture.clone()).to_rgb8();
            picture.save_with_format(&path, format).unwrap();
            assert_eq!(truncation(&path).unwrap(), None, "{end}");
            let whole = std::fs::read(&path).unwrap();
            for kept in [whole.len() / 2, whole.len() - 1 - whole.len() / 20] {
                std::fs::write(&path, &whole[..kept]).unwrap();
                let found = truncation(&path).unwrap();
                // The directory of this TIFF file comes last: the decoder misses it.
                assert!(found.is_some() || end == "tif", "{end} {kept}");
            }
            // Bytes that a camera adds after the end.
            std::fs::write(&path, [&whole[..], &[0; 100]].concat()).unwrap();
            assert_eq!(truncation(&path).unwrap(), None, "{end}");
        }
    }

    /// A TIFF file whose directory comes first, as cameras write it: one strip of 4 × 2 pixels.
    #[test]
    fn the_strips_of_a_tiff_file_say_where_it_ends() {
        let entry = |tag: u16, value: u32| {
            let long = 4u16;
            let head = [tag.to_le_bytes(), long.to_le_bytes()].concat();
            [
                head,
                1u32.to_le_bytes().to_vec(),
                value.to_le_bytes().to_vec(),
            ]
            .concat()
        };
        // Width, height, bits, compression, photometric, offset, rows of a strip, its bytes.
        let tags = [256, 257, 258, 259, 262, 273, 278, 279];
        let values = [4, 2, 8, 1, 1, 110, 2, 8];
        let entries = tags
            .into_iter()
            .zip(values)
            .flat_map(|(tag, value)| entry(tag, value));
        let head = b"II\x2a\0\x08\0\0\0\x08\0".iter().copied();
        let file: Vec<u8> = head.chain(entries).chain([0; 4]).chain(1..=8).collect();
        assert_eq!(file.len(), 110 + 8);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.tif");
        std::fs::write(&path, &file).unwrap();
        assert_eq!(truncation(&path).unwrap(), None);
        std::fs::write(&path, &file[..117]).unwrap();
        assert_eq!(truncation(&path).unwrap(), Some(truncated("TIFF")));
    }

    #[test]
    fn what_is_no_picture_or_missing_is_left_to_the_decoder() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.png");
        assert!(truncation(&path).is_err());
        for content in [&b""[..], b"x", b"II", b"II*\0\xff\xff\xff\xff", b"RIFF"] {
            std::fs::write(&path, content).unwrap();
            assert_eq!(truncation(&path).unwrap(), None);
        }
    }
}
