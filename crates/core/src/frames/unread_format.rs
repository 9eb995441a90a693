//! Pictures in formats that are not read, and the commands that convert them.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use tunnelstitch_geometry::files::{open_regular, printed};

/// First bytes that tell a format.
const START_BYTES: u64 = 16;
/// Largest number of tags of a TIFF file that are looked at.
const MAX_TIFF_TAGS: u64 = 512;
/// Bytes of a tag in a TIFF file's directory (TIFF 6.0, section 2).
const TIFF_TAG_BYTES: usize = 12;
/// The tag of the kind of numbers (TIFF 6.0, section 19).
const SAMPLE_FORMAT: u16 = 339;
/// Its value for floating point numbers.
const FLOATING_POINT: u16 = 3;
/// The tag that a DNG file has (Digital Negative Specification 1.7).
const DNG_VERSION: u16 = 50706;
/// Brands of HEIF and AVIF files (ISO/IEC 23008-12, annex B; AV1 Image File Format 1.1).
const HEIF_BRANDS: [&[u8]; 9] = [
    b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1", b"avif",
];

/// Extensions of raw pictures other than DNG; most of them begin like TIFF files.
pub(crate) const RAW_EXTENSIONS: [&str; 10] = [
    "cr2", "cr3", "nef", "arw", "orf", "rw2", "raf", "pef", "srw", "raw",
];

/// A format of pictures that is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnreadFormat {
    /// Windows bitmap.
    Bmp,
    /// GIF.
    Gif,
    /// Netpbm's PGM, PPM and PFM, which cameras of machine vision write.
    Netpbm,
    /// JPEG 2000.
    Jpeg2000,
    /// JPEG XL.
    JpegXl,
    /// OpenEXR.
    OpenExr,
    /// HEIF or AVIF, as phones write them.
    Heif,
    /// Adobe's Digital Negative.
    Dng,
    /// Raw pictures of a camera's maker.
    Raw,
    /// TIFF with floating point numbers.
    FloatTiff,
}

impl UnreadFormat {
    /// The format of a file, by its content; None for all others, and for what cannot be read.
    pub fn of(path: &Path) -> Option<Self> {
        let mut file = open_regular(path).ok()?;
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        if RAW_EXTENSIONS.contains(&extension.to_lowercase().as_str()) {
            return Some(Self::Raw);
        }
        let mut start = Vec::new();
        (&file).take(START_BYTES).read_to_end(&mut start).ok()?;
        match start.as_slice() {
            [b'B', b'M', ..] => Some(Self::Bmp),
            [b'G', b'I', b'F', b'8', ..] => Some(Self::Gif),
            [
                b'P',
                b'2' | b'3' | b'5' | b'6' | b'7' | b'f' | b'F',
                end,
                ..,
            ] if end.is_ascii_whitespace() => Some(Self::Netpbm),
            [0, 0, 0, 12, b'j', b'P', b' ', b' ', ..] => Some(Self::Jpeg2000),
            [0, 0, 0, 12, b'J', b'X', b'L', b' ', ..] | [0xff, 0x0a, ..] => Some(Self::JpegXl),
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Self::OpenExr),
            [_, _, _, _, b'f', b't', b'y', b'p', rest @ ..] => {
                let is_heif = HEIF_BRANDS.iter().any(|brand| rest.starts_with(brand));
                is_heif.then_some(Self::Heif)
            }
            [b'I', b'I', 42, 0, ..] => Self::of_tiff(&mut file, u16::from_le_bytes).ok()?,
            [b'M', b'M', 0, 42, ..] => Self::of_tiff(&mut file, u16::from_be_bytes).ok()?,
            _ => None,
        }
    }

    /// The format of a TIFF file by the tags of its first directory; `number` is its byte order.
    fn of_tiff(file: &mut File, number: fn([u8; 2]) -> u16) -> io::Result<Option<Self>> {
        let mut two = |from: SeekFrom| {
            let mut bytes = [0; 2];
            file.seek(from)?;
            file.read_exact(&mut bytes)?;
            Ok::<u64, io::Error>(u64::from(number(bytes)))
        };
        let (first, second) = (two(SeekFrom::Start(4))?, two(SeekFrom::Start(6))?);
        let is_little = number([1, 0]) == 1;
        let directory = if is_little {
            second << 16 | first
        } else {
            first << 16 | second
        };
        let count = two(SeekFrom::Start(directory))?.min(MAX_TIFF_TAGS);
        let mut tags = Vec::new();
        file.take(count * TIFF_TAG_BYTES as u64)
            .read_to_end(&mut tags)?;
        let one = if is_little { (1, 0) } else { (0, 1) };
        let mut format = None;
        for tag in tags.chunks_exact(TIFF_TAG_BYTES) {
            let field = |at: usize| number([tag[at], tag[at + 1]]);
            match field(0) {
                DNG_VERSION => return Ok(Some(Self::Dng)),
                // The value of a single channel; colours of this kind are read.
                SAMPLE_FORMAT if (field(4), field(6)) == one && field(8) == FLOATING_POINT => {
                    format = Some(Self::FloatTiff);
                }
                _ => {}
            }
        }
        Ok(format)
    }

    /// The name for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bmp => "BMP",
            Self::Gif => "GIF",
            Self::Netpbm => "PGM, PPM or PFM",
            Self::Jpeg2000 => "JPEG 2000",
            Self::JpegXl => "JPEG XL",
            Self::OpenExr => "OpenEXR",
            Self::Heif => "HEIF or AVIF",
            Self::Dng => "DNG",
            Self::Raw => "a raw picture",
            Self::FloatTiff => "TIFF with floating point numbers",
        }
    }

    /// The remedy for a file of the format: the command that converts all files beside it with the
    /// same extension.
    pub fn remedy(self, path: &Path) -> String {
        let files = all_beside(path);
        let (command, program, extension) = match self {
            Self::Bmp | Self::Gif | Self::Netpbm | Self::Jpeg2000 => {
                let command = format!("mogrify -format png {files}");
                (command, "ImageMagick", "png")
            }
            // ImageMagick reads these from 0 to 1 only.
            Self::FloatTiff => {
                let each = "gdal_translate -q -ot UInt16 -scale 0 1 0 65535 -of PNG \"$f\" \
                            \"${f%.*}.png\"";
                let command = format!("for f in {files}; do {each}; done");
                let program = "GDAL; instead of 0 1 the values that become black and white";
                (command, program, "png")
            }
            Self::OpenExr => {
                let each =
                    "ffmpeg -v error -y -i \"$f\" -pix_fmt rgb48be \"${f%.*}.png\" < /dev/null";
                let command = format!("for f in {files}; do {each}; done");
                (command, "ffmpeg, for values from 0 to 1", "png")
            }
            Self::JpegXl => {
                let each = "djxl \"$f\" \"${f%.*}.png\"";
                let command = format!("for f in {files}; do {each}; done");
                (command, "libjxl", "png")
            }
            Self::Heif => {
                let each = "heif-convert \"$f\" \"${f%.*}.png\"";
                let command = format!("for f in {files}; do {each}; done");
                (command, "libheif", "png")
            }
            Self::Dng | Self::Raw => (format!("dcraw -T -6 -W -w {files}"), "dcraw", "tiff"),
        };
        format!(
            "convert the frames by `{command}` ({program}) and let frames.images match \
             *.{extension}"
        )
    }
}

/// The pattern of a shell for all files beside a file with its extension.
fn all_beside(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    let all = format!("*.{}", printed(Path::new(extension)));
    match path.parent() {
        Some(folder) if folder != Path::new("") => {
            format!("{}/{all}", quoted(&printed(folder).to_string()))
        }
        _ => all,
    }
}

/// A word as a shell reads it: in quotes, if it holds more than letters, digits and `/._-`.
fn quoted(word: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-".contains(c);
    if word.chars().all(is_plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''")).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageBuffer, Rgb};

    fn format_of(bytes: &[u8]) -> Option<UnreadFormat> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.any");
        std::fs::write(&path, bytes).unwrap();
        UnreadFormat::of(&path)
    }

    /// A TIFF file of one directory with these tags, each with one number of 16 bits.
    fn tiff(is_little: bool, tags: &[(u16, u16)]) -> Vec<u8> {
        let two = |value: u16| match is_little {
            true => value.to_le_bytes(),
            false => value.to_be_bytes(),
        };
        let four = |value: u16| match is_little {
            true => [two(value), [0; 2]].concat(),
            false => [[0; 2], two(value)].concat(),
        };
        let order = if is_little { b"II" } else { b"MM" };
        let head = [&order[..], &two(42), &four(8), &two(tags.len() as u16)].concat();
        let mut bytes = head;
        for (tag, value) in tags {
            bytes.extend([two(*tag), two(3)].concat());
            bytes.extend([&four(1)[..], &two(*value), &[0; 2]].concat());
        }
        bytes
    }

    #[test]
    fn formats_are_told_by_their_content() {
        for (bytes, expected) in [
            (&b"BM\x7a\xe9\x07\0"[..], UnreadFormat::Bmp),
            (b"GIF89a\x10\0", UnreadFormat::Gif),
            (b"P5\n4 4\n255\n", UnreadFormat::Netpbm),
            (b"Pf\n4 4\n-1.0\n", UnreadFormat::Netpbm),
            (b"\0\0\0\x0cjP  \r\n\x87\n", UnreadFormat::Jpeg2000),
            (b"\0\0\0\x0cJXL \r\n\x87\n", UnreadFormat::JpegXl),
            (b"\xff\x0a\xfa\x7f", UnreadFormat::JpegXl),
            (b"v/1\x01\x02\0\0\0", UnreadFormat::OpenExr),
            (b"\0\0\0\x1cftypheic\0\0\0\0", UnreadFormat::Heif),
            (b"\0\0\0\x1cftypavif\0\0\0\0", UnreadFormat::Heif),
        ] {
            assert_eq!(format_of(bytes), Some(expected));
        }
        for is_little in [true, false] {
            let told = |tags| format_of(&tiff(is_little, tags));
            assert_eq!(told(&[(256, 9), (DNG_VERSION, 1)]), Some(UnreadFormat::Dng));
            assert_eq!(told(&[(SAMPLE_FORMAT, 3)]), Some(UnreadFormat::FloatTiff));
            assert_eq!(told(&[(256, 9), (SAMPLE_FORMAT, 1)]), None);
        }
        for bytes in [
            &b""[..],
            b"B",
            b"P5",
            b"II*\0",
            b"MM\0*\xff\xff\xff\xff",
            b"\0\0\0 ftypisom",
        ] {
            assert_eq!(format_of(bytes), None);
        }
    }

    #[test]
    fn raw_pictures_are_told_by_their_names() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("DSC_0001.NEF");
        std::fs::write(&path, b"MM\0*\0\0\0\x08").unwrap();
        assert_eq!(UnreadFormat::of(&path), Some(UnreadFormat::Raw));
    }

    #[test]
    fn what_is_read_is_no_unread_format() {
        let dir = tempfile::tempdir().unwrap();
        let picture: DynamicImage = ImageBuffer::from_pixel(8, 6, Rgb([9u8, 8, 7])).into();
        for name in ["a.png", "a.jpg", "a.tif", "a.webp"] {
            let path = dir.path().join(name);
            picture.save(&path).unwrap();
            assert_eq!(UnreadFormat::of(&path), None, "{name}");
        }
    }

    #[test]
    fn the_command_converts_all_files_beside() {
        let remedy = UnreadFormat::Bmp.remedy(Path::new("my frames/1.BMP"));
        assert!(
            remedy.contains("`mogrify -format png 'my frames'/*.BMP`"),
            "{remedy}"
        );
        let remedy = UnreadFormat::FloatTiff.remedy(Path::new("f/1.tif"));
        assert!(
            remedy.contains("for f in f/*.tif; do gdal_translate")
                && remedy.contains("instead of 0 1"),
            "{remedy}"
        );
        let remedy = UnreadFormat::OpenExr.remedy(Path::new("1.exr"));
        assert!(
            remedy.contains("do ffmpeg -v error -y -i \"$f\""),
            "{remedy}"
        );
        let remedy = UnreadFormat::Dng.remedy(Path::new("1.dng"));
        assert!(remedy.contains("`dcraw -T -6 -W -w *.dng`"), "{remedy}");
        assert!(remedy.ends_with("*.tiff"), "{remedy}");
    }
}
