//! Groups of pictures in a searched folder.

use crate::frames::{
    FrameFile, PictureOrientation, PictureReading, UNUSED_UPPER_BITS, brightest_bits, list_frames,
};
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::trajectory::times;

/// The pictures of one folder with one extension, in any capitals.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureGroup {
    /// Glob pattern, relative to the searched folder.
    pub pattern: String,
    /// The first picture, relative to the searched folder.
    pub first: PathBuf,
    /// Number of pictures; of TIFF files with several pages, that of these.
    pub count: usize,
    /// True if the name of the first picture has its time, or its EXIF data have.
    pub has_time: bool,
    /// Width and height of the first picture, pixels, if readable.
    pub size: Option<(u32, u32)>,
    /// Width and height of the first picture when it is turned or mirrored as its EXIF data ask,
    /// if they do.
    pub turned_size: Option<(u32, u32)>,
    /// The reason why the first picture cannot be read, with the remedy.
    pub fault: Option<String>,
}

impl PictureGroup {
    /// The group of the files of a folder's `parent` with one extension; `folder` is the searched
    /// one, to which paths are relative.
    pub(super) fn of(folder: &Path, parent: &Path, files: &[&PathBuf]) -> Self {
        // Names of folders may hold what a pattern gives a meaning.
        let parent = glob::Pattern::escape(&parent.to_string_lossy());
        let pattern = Path::new(&parent).join(format!("*.{}", extension_pattern(files)));
        let path = files.first().map(|first| folder.join(first));
        let stem = path
            .as_deref()
            .and_then(Path::file_stem)
            .unwrap_or_default();
        let is_in_name = times::from_name(&stem.to_string_lossy(), None).is_some();
        let first = FrameFile::picture(0, path.unwrap_or_default());
        let has_time = is_in_name || first.exif_time_s().is_some();
        let frame = |file: &&PathBuf| FrameFile::picture(0, folder.join(file));
        let pages = |file: &&PathBuf| frame(file).split_into_pages().len();
        // Stacks are of one kind: a folder of single pages is not opened file by file.
        let frames = match files.first().map(pages) {
            None | Some(1) => files.len(),
            Some(_) => files.iter().map(pages).sum(),
        };
        let size = first.size();
        let is_turned = first.exif_orientation().is_ok_and(|named| named.is_some());
        let exif = PictureReading {
            orientation: PictureOrientation::Exif,
            ..PictureReading::default()
        };
        Self {
            pattern: pattern.to_string_lossy().replace('\\', "/"),
            first: files
                .first()
                .map_or_else(PathBuf::new, |first| first.to_path_buf()),
            count: frames,
            has_time,
            fault: size.as_ref().err().map(ToString::to_string),
            size: size.ok(),
            turned_size: match is_turned {
                true => first.with_reading(exif).size().ok(),
                false => None,
            },
        }
    }

    /// True for pictures beside those of another group, of their size and with other names: they
    /// may belong to the same sequence.
    pub fn may_continue(&self, frames: &Self) -> bool {
        self.first.parent() == frames.first.parent()
            && self.first.file_stem() != frames.first.file_stem()
            && self.size.is_some()
            && self.size == frames.size
    }

    /// The orientation that a calibration for pictures of `size` asks for, where EXIF data name
    /// one; None where there are none, or the calibration fits both or neither.
    pub fn orientation(&self, size: (u32, u32)) -> Option<PictureOrientation> {
        let turned = self.turned_size?;
        match (self.size == Some(size), turned == size) {
            (false, true) => Some(PictureOrientation::Exif),
            (true, false) => Some(PictureOrientation::Stored),
            (true, true) | (false, false) => None,
        }
    }

    /// Bits of the values, if the pictures are files of 16 bits and all leave their upper bits
    /// empty. `folder` is the searched one, `size` that of the calibration: other pictures are not
    /// decoded.
    pub(super) fn bits(&self, folder: &Path, mask: Option<&Path>, size: (u32, u32)) -> Option<u32> {
        let reading = PictureReading {
            orientation: self.orientation(size).unwrap_or_default(),
            ..PictureReading::default()
        };
        let frames = list_frames(folder, &self.pattern, mask).ok()?.into_iter();
        let frames: Vec<FrameFile> = frames.map(|file| file.with_reading(reading)).collect();
        brightest_bits(&frames, size).filter(|bits| UNUSED_UPPER_BITS.contains(bits))
    }
}

/// The pattern of the extensions of files, which differ in capitals at most.
fn extension_pattern(files: &[&PathBuf]) -> String {
    let extension = |file: &&PathBuf| {
        let extension = file.extension().unwrap_or_default();
        extension.to_string_lossy().into_owned()
    };
    let mut extensions = files.iter().map(extension);
    let first = extensions.next().unwrap_or_default();
    if extensions.all(|other| other == first) {
        return first;
    }
    let either = |c: char| format!("[{}{}]", c.to_ascii_lowercase(), c.to_ascii_uppercase());
    first.chars().map(either).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group_of(dir: &Path, names: &[&str]) -> PictureGroup {
        let files: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        let files: Vec<&PathBuf> = files.iter().collect();
        PictureGroup::of(dir, Path::new(""), &files)
    }

    #[test]
    fn extensions_may_differ_in_capitals() {
        let dir = tempfile::tempdir().unwrap();
        let names = ["1.jpg", "2.JPG", "3.Jpg"];
        for name in names {
            image::GrayImage::new(8, 6)
                .save(dir.path().join(name))
                .unwrap();
        }
        let group = group_of(dir.path(), &names);
        assert_eq!(group.pattern, "*.[jJ][pP][gG]");
        let listed = list_frames(dir.path(), &group.pattern, None).unwrap();
        assert_eq!(listed.len(), 3);
        assert_eq!(group_of(dir.path(), &names[1..2]).pattern, "*.JPG");
        // Of a sequence, and a copy.
        image::GrayImage::new(8, 6)
            .save(dir.path().join("4.png"))
            .unwrap();
        image::GrayImage::new(8, 6)
            .save(dir.path().join("1.png"))
            .unwrap();
        assert!(group_of(dir.path(), &["4.png"]).may_continue(&group));
        assert!(!group_of(dir.path(), &["1.png", "4.png"]).may_continue(&group));
    }

    #[test]
    fn the_calibration_tells_the_orientation() {
        let group = |turned_size| PictureGroup {
            pattern: "*.jpg".to_owned(),
            first: PathBuf::new(),
            count: 1,
            has_time: false,
            size: Some((64, 48)),
            turned_size,
            fault: None,
        };
        let quarter = group(Some((48, 64)));
        assert_eq!(
            quarter.orientation((48, 64)),
            Some(PictureOrientation::Exif)
        );
        assert_eq!(
            quarter.orientation((64, 48)),
            Some(PictureOrientation::Stored)
        );
        assert_eq!(quarter.orientation((32, 24)), None);
        assert_eq!(group(Some((64, 48))).orientation((64, 48)), None);
        assert_eq!(group(None).orientation((64, 48)), None);
    }

    #[test]
    fn empty_upper_bits_are_found() {
        let dir = tempfile::tempdir().unwrap();
        let bits = |brightest: u16| {
            for k in 0..3 {
                let value = brightest >> k;
                let picture = image::ImageBuffer::from_pixel(8, 6, image::Luma([value]));
                picture.save(dir.path().join(format!("{k}.png"))).unwrap();
            }
            let group = group_of(dir.path(), &["0.png", "1.png", "2.png"]);
            assert_eq!(group.bits(dir.path(), None, (60000, 60000)), None);
            group.bits(dir.path(), None, (8, 6))
        };
        assert_eq!(bits(4000), Some(12));
        assert_eq!(bits(40000), None);
        // Values of 8 bits, and dark pictures.
        assert_eq!(bits(200), Some(8));
        assert_eq!(bits(100), None);
    }
}
