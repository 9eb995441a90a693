//! Pages of TIFF files as frames.
//!
//! Each page has a directory of its own, and the header names the first one (TIFF 6.0, section 2;
//! BigTIFF alike). Read with the header of another page, a file is a picture of that page, for any
//! decoder.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use tunnelstitch_geometry::files::open_regular;

/// Largest number of pages of a file.
const MAX_PAGES: usize = 100_000;
/// Length of a header, bytes.
const HEADER_BYTES: usize = 8;
/// Length of a BigTIFF's header, bytes.
const BIG_HEADER_BYTES: usize = 16;
/// The number of a BigTIFF, in place of 42.
const BIG_NUMBER: u16 = 43;

/// True for a file that is named as TIFF files are.
pub(super) fn is_tiff_name(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    ["tif", "tiff"]
        .iter()
        .any(|name| extension.eq_ignore_ascii_case(name))
}

/// The directories of those pages of a TIFF file that are as large as the first one, as their
/// places in the file, bytes; none for other files, and for those that cannot be read. Smaller
/// pages are previews.
pub(super) fn directories(path: &Path) -> Vec<u64> {
    let Ok(file) = open_regular(path) else {
        return Vec::new();
    };
    let Ok(mut decoder) = tiff::decoder::Decoder::new(BufReader::new(file)) else {
        return Vec::new();
    };
    let size = decoder.dimensions().ok();
    let mut directories = Vec::new();
    for _ in 0..MAX_PAGES {
        if size.is_some() && decoder.dimensions().ok() == size {
            directories.extend(decoder.ifd_pointer().map(|pointer| pointer.0));
        }
        if !decoder.more_images() || decoder.next_image().is_err() {
            break;
        }
    }
    directories
}

/// A TIFF file with the directory of one page as its first.
pub(super) struct PageFile {
    file: File,
    position: u64,
    /// The header, which names that directory.
    header: Vec<u8>,
}

impl PageFile {
    /// Opens the page whose directory is at `directory`.
    ///
    /// # Errors
    /// An error of the operating system; what is no regular file, or shorter than a header.
    pub fn open(path: &Path, directory: u64) -> io::Result<Self> {
        let mut file = open_regular(path)?;
        let mut header = vec![0; HEADER_BYTES];
        file.read_exact(&mut header)?;
        let is_little = header.starts_with(b"II");
        let number = [header[2], header[3]];
        let number = if is_little {
            u16::from_le_bytes(number)
        } else {
            u16::from_be_bytes(number)
        };
        // The offset is the last number of the header.
        let width = if number == BIG_NUMBER {
            header.resize(BIG_HEADER_BYTES, 0);
            file.read_exact(&mut header[HEADER_BYTES..])?;
            size_of::<u64>()
        } else {
            size_of::<u32>()
        };
        let offset = header.len() - width;
        if is_little {
            header[offset..].copy_from_slice(&directory.to_le_bytes()[..width]);
        } else {
            let bytes = directory.to_be_bytes();
            header[offset..].copy_from_slice(&bytes[bytes.len() - width..]);
        }
        Ok(Self {
            position: file.seek(SeekFrom::Start(0))?,
            file,
            header,
        })
    }

    /// Length of the file, bytes.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn file_bytes(&self) -> io::Result<u64> {
        Ok(self.file.metadata()?.len())
    }
}

impl Read for PageFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        let header = self.header.iter().skip(self.position as usize);
        for (byte, own) in buffer[..count].iter_mut().zip(header) {
            *byte = *own;
        }
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for PageFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = self.file.seek(to)?;
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiff::decoder::Decoder;
    use tiff::encoder::{TiffEncoder, TiffKind, colortype};

    /// Writes pages of a grey value each.
    fn write<K: TiffKind>(mut encoder: TiffEncoder<File, K>, pages: &[(u8, [u32; 2])]) {
        for (grey, [width, height]) in pages {
            let page = vec![*grey; (width * height) as usize];
            encoder
                .write_image::<colortype::Gray8>(*width, *height, &page)
                .unwrap();
        }
    }

    const PAGES: [(u8, [u32; 2]); 4] = [(10, [4, 3]), (20, [4, 3]), (30, [2, 1]), (40, [4, 3])];

    #[test]
    fn pages_as_large_as_the_first_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("stack.tif");
        for is_big in [false, true] {
            let file = File::create(&path).unwrap();
            if is_big {
                write(TiffEncoder::new_big(file).unwrap(), &PAGES);
            } else {
                write(TiffEncoder::new(file).unwrap(), &PAGES);
            }
            let directories = directories(&path);
            assert_eq!(directories.len(), 3);
            for (directory, grey) in directories.into_iter().zip([10, 20, 40]) {
                let page = PageFile::open(&path, directory).unwrap();
                let mut decoder = Decoder::new(BufReader::new(page)).unwrap();
                let mut pixels = [0; 12];
                decoder.read_image_bytes(&mut pixels).unwrap();
                assert_eq!(pixels, [grey; 12]);
            }
        }
    }

    #[test]
    fn other_files_have_no_pages() {
        let dir = tempfile::tempdir().unwrap();
        let other = dir.path().join("a.tif");
        for content in [&b""[..], b"II*\0", b"II*\0\x08\0\0\0\xff\xff"] {
            std::fs::write(&other, content).unwrap();
            assert!(directories(&other).is_empty());
        }
        assert!(directories(&dir.path().join("missing.tif")).is_empty());
        assert!(PageFile::open(&other, 8).is_ok());
        std::fs::write(&other, b"II*\0").unwrap();
        assert!(PageFile::open(&other, 8).is_err());
    }
}
