//! Listing of the frames that `[frames]` names.

use super::error::SurveyError;
use super::file::FramesSection;
use super::frame_times;
use crate::frames::{
    self, FrameFile, PictureOrientation, PictureReading, RecordedImages, UNUSED_UPPER_BITS, Video,
    brightest_bits,
};
use crate::storage::{Mirror, StorageUrl};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::CameraAxes;

/// The frames that a `[frames]` section names.
pub(super) struct FrameList {
    /// The frames, sorted by name or time.
    pub frames: Vec<FrameFile>,
    /// Times of the frames, seconds, if given by a file, a video or a recording.
    pub times_s: Option<Vec<f64>>,
    /// The video that contains the frames, if any.
    pub video: Option<Arc<Video>>,
}

/// The largest value of so many bits, 1 to 16.
fn white(bits: u8) -> u16 {
    u16::MAX >> (16 - bits)
}

/// The reading of picture files that a section asks for.
///
/// # Errors
/// A number of bits that no file has, in words.
fn picture_reading(section: &FramesSection) -> Result<PictureReading, &'static str> {
    let bits = section.bits.unwrap_or(16);
    if !(8..=16).contains(&bits) {
        return Err(
            "frames.bits must be between 8 and 16, those of the values in files of 16 bits",
        );
    }
    Ok(PictureReading {
        white: white(bits),
        orientation: section.orientation.unwrap_or_default(),
    })
}

/// The interval of the frames among the pictures of a video or recording.
///
/// # Errors
/// An interval of 0, in words.
fn interval(section: &FramesSection) -> Result<usize, &'static str> {
    match section.every {
        Some(0) => Err("frames.every is 0; 1 takes every picture, 2 every other one"),
        every => Ok(every.unwrap_or(1)),
    }
}

/// Checks the keys that go with `images`; returns the reading of the files.
///
/// # Errors
/// A key that goes with a video, in words; the errors of [`picture_reading`].
fn check_images(section: &FramesSection) -> Result<PictureReading, &'static str> {
    if section.angle_step_deg.is_some() {
        return Err(
            "frames.angle_step_deg goes with frames.video and frames.bag; for pictures, let \
             frames.images match fewer of them",
        );
    }
    if section.every.is_some() {
        return Err(
            "frames.every goes with frames.video and frames.bag; for pictures, let frames.images \
             match fewer of them",
        );
    }
    picture_reading(section)
}

/// Checks the keys that go with `video`; returns the interval of the frames.
///
/// # Errors
/// A key that goes with pictures, in words; the errors of [`interval`].
fn check_video(section: &FramesSection) -> Result<usize, &'static str> {
    if section.skip_bad == Some(true) {
        return Err(
            "frames.skip_bad goes with frames.images and frames.bag; the pictures of a video \
             cannot be left out singly",
        );
    }
    if section.bits.is_some() || section.orientation.is_some() {
        return Err(
            "frames.bits and frames.orientation go with frames.images and frames.bag; videos tell \
             both themselves",
        );
    }
    interval(section)
}

/// The frames of files, of which TIFF files with several pages contain as many.
fn split_into_pages(files: Vec<FrameFile>) -> Vec<FrameFile> {
    let split = files.par_map(|file| file.clone().split_into_pages());
    let frames = split.into_iter().flatten().enumerate();
    frames.map(|(index, frame)| frame.numbered(index)).collect()
}

impl FrameList {
    /// Finds the frames that the section of the survey at `toml_path` names, relative to its
    /// `folder`. `frame_times`: a file of their times, instead of the survey's. A mask in the same
    /// folder is not a frame.
    ///
    /// # Errors
    /// No pictures, video or recording, or more than one; a malformed pattern, no frames, frames on
    /// storage that cannot be fetched, a video or recording that cannot be read, a malformed file
    /// of times.
    pub fn new(
        section: &FramesSection,
        toml_path: &Path,
        folder: &Path,
        frame_times: Option<&Path>,
    ) -> Result<Self, SurveyError> {
        let value = |what: &str| SurveyError::Value {
            path: toml_path.to_owned(),
            what: what.to_owned(),
        };
        let fail = |what: &str| Err(value(what));
        if section.topic.is_some() && section.bag.is_none() {
            return fail("frames.topic goes with frames.bag");
        }
        let mut listing = match (&section.images, &section.video, &section.bag) {
            (Some(pattern), None, None) => {
                let reading = check_images(section).map_err(value)?;
                let mask = section.mask.as_ref().map(|mask| folder.join(mask));
                let stored = StorageUrl::parse(pattern)?;
                let fetched = stored.map(|url| Mirror::of_user().fetch_pattern(&url));
                let pattern = fetched.unwrap_or_else(|| Ok(pattern.clone()))?;
                let listed = frames::list_frames(folder, &pattern, mask.as_deref())?;
                Self::of_images(split_into_pages(listed), reading)
            }
            (None, Some(video), None) => {
                let every = check_video(section).map_err(value)?;
                let video = Arc::new(Video::open(&folder.join(video))?);
                Self::of_video(video, every)
            }
            (None, None, Some(bag)) => {
                let every = interval(section).map_err(value)?;
                let reading = picture_reading(section).map_err(value)?;
                let images = RecordedImages::open(&folder.join(bag), section.topic.as_deref())?;
                Self::of_recording(&Arc::new(images), every, reading)
            }
            (None, None, None) => {
                return fail(
                    "frames has neither images (a pattern, as \"frames/*.jpg\"), nor video, nor \
                     bag (a file)",
                );
            }
            _ => return fail("frames has more than one of images, video and bag; keep one"),
        };
        let own = section.times.as_ref().map(|times| folder.join(times));
        if let Some(path) = frame_times.or(own.as_deref()) {
            listing.times_s = Some(frame_times::read(path, &listing.frames, section.time_unit)?);
        }
        Ok(listing)
    }

    /// Width and height of the first frame, pixels, for a calibration that does not state them;
    /// [`None`] if there is none that can be read, which is an error of its own later.
    pub fn first_size(
        section: &FramesSection,
        toml_path: &Path,
        folder: &Path,
    ) -> Option<[u32; 2]> {
        let listed = Self::new(section, toml_path, folder, None).ok()?;
        let (width, height) = listed.frames.iter().find_map(|frame| frame.size().ok())?;
        Some([width, height])
    }

    /// The frames with pictures read as turned for display, if only these have the `size` of the
    /// calibration; also the warning that they are, or that they are not although their EXIF data
    /// name an orientation, or several. A section that says which is followed without a word.
    pub fn oriented(mut self, size: (u32, u32), section: &FramesSection) -> (Self, Option<String>) {
        if section.orientation.is_some() {
            return (self, None);
        }
        let named = NamedOrientations::of(&self.frames);
        let Some(first) = named.first.map(|k| &self.frames[k]) else {
            return (self, None);
        };
        let number = named.only();
        let named = named.sentence(&printed(first.file()).to_string());
        let turned = PictureReading {
            orientation: PictureOrientation::Exif,
            ..picture_reading(section).unwrap_or_default()
        };
        let fits = |frame: &FrameFile| frame.size().is_ok_and(|found| found == size);
        let is_turned = !fits(first) && fits(&first.clone().with_reading(turned));
        if is_turned {
            let frames = self.frames.into_iter();
            self.frames = frames.map(|frame| frame.with_reading(turned)).collect();
        }
        let axes = number.and_then(CameraAxes::before_turning);
        (self, Some(orientation_warning(&named, is_turned, axes)))
    }

    /// The bits of the brightest value of all frames of lists, if that leaves the upper bits of
    /// their files of 16 bits empty and the section does not say what these hold; `size` is that of
    /// the calibrations, pixels.
    pub fn used_bits(lists: &[Self], size: (u32, u32), section: &FramesSection) -> Option<u8> {
        if section.bits.is_some() {
            return None;
        }
        let of_lists = lists.iter().map(|list| brightest_bits(&list.frames, size));
        let brightest = of_lists.flatten().max()?;
        let bits = UNUSED_UPPER_BITS.contains(&brightest).then_some(brightest);
        bits.and_then(|bits| bits.try_into().ok())
    }

    /// The frames with values of so many bits in files of 16.
    pub fn with_bits(mut self, bits: u8) -> Self {
        let frames = self.frames.into_iter();
        let read = frames.map(|frame| match frame.reading() {
            Some(reading) => frame.with_reading(PictureReading {
                white: white(bits),
                ..reading
            }),
            None => frame,
        });
        self.frames = read.collect();
        self
    }

    fn of_images(listed: Vec<FrameFile>, reading: PictureReading) -> Self {
        let read = listed.into_iter().map(|frame| frame.with_reading(reading));
        Self {
            frames: read.collect(),
            times_s: None,
            video: None,
        }
    }

    fn of_recording(images: &Arc<RecordedImages>, every: usize, reading: PictureReading) -> Self {
        let numbers = || (0..images.count()).step_by(every);
        let frame = |(index, image): (usize, usize)| {
            FrameFile::in_recording(index, images, image).with_reading(reading)
        };
        Self {
            frames: numbers().enumerate().map(frame).collect(),
            times_s: Some(numbers().map(|image| images.time_s(image)).collect()),
            video: None,
        }
    }

    fn of_video(video: Arc<Video>, every: usize) -> Self {
        let pictures = || (0..video.pictures()).step_by(every);
        let frame = |(index, picture): (usize, usize)| FrameFile::in_video(index, &video, picture);
        Self {
            frames: pictures().enumerate().map(frame).collect(),
            times_s: Some(pictures().map(|picture| video.time_s(picture)).collect()),
            video: Some(video),
        }
    }
}

/// The orientations that EXIF data of frames name.
struct NamedOrientations {
    /// Number of frames with each; 1 is as stored.
    counts: BTreeMap<u8, usize>,
    /// Place of the first frame with another than 1.
    first: Option<usize>,
}

impl NamedOrientations {
    /// Opens all files; of a recording, its first image. Files that cannot be read are errors of
    /// their own.
    fn of(frames: &[FrameFile]) -> Self {
        let own_files = frames.iter().all(|frame| frame.shared_file().is_none());
        let opened = if own_files {
            frames
        } else {
            &frames[..frames.len().min(1)]
        };
        let numbers = opened.par_map(|frame| frame.exif_orientation().ok());
        let mut counts = BTreeMap::new();
        for number in numbers.iter().flatten() {
            *counts.entry(number.unwrap_or(1)).or_default() += 1;
        }
        let is_other = |number: &Option<Option<u8>>| matches!(number, Some(Some(_)));
        Self {
            counts,
            first: numbers.iter().position(is_other),
        }
    }

    /// The orientation, if there is one.
    fn only(&self) -> Option<u8> {
        let number = self.counts.keys().next().copied();
        number.filter(|_| self.counts.len() == 1)
    }

    /// The orientations, in words; `file`: the first frame with one.
    fn sentence(&self, file: &str) -> String {
        let counts: Vec<String> = self
            .counts
            .iter()
            .map(|(number, count)| format!("{number} of {count}"))
            .collect();
        match self.counts.iter().last() {
            Some((number, _)) if self.counts.len() == 1 => format!(
                "{file}: by its EXIF orientation ({number}) it is to be turned or mirrored for \
                 display"
            ),
            _ => format!(
                "the frames have different EXIF orientations ({} frames), by which some, as \
                 {file}, are to be turned or mirrored for display",
                counts.join(", ")
            ),
        }
    }
}

/// The warning that pictures whose EXIF data name an orientation are turned, or that they are not;
/// `axes`: those of the camera with the pictures as stored.
fn orientation_warning(named: &str, is_turned: bool, axes: Option<CameraAxes>) -> String {
    if is_turned {
        let otherwise = axes.map(|axes| {
            let name = axes.name();
            format!(" (if they are not, camera_axes = \"{name}\" under [poses])")
        });
        format!(
            "{named}, which is done, since the calibration fits only that; the poses must be \
             those of the camera turned likewise{}; orientation = \"exif\" under [frames] confirms \
             it",
            otherwise.unwrap_or_default()
        )
    } else {
        format!(
            "{named}, which is not done, since the calibration fits the pictures as they are \
             stored; if the camera was calibrated with turned pictures, add orientation = \
             \"exif\" under [frames], otherwise orientation = \"stored\""
        )
    }
}

/// The warning that values of files of 16 bits are read as of the bits that they use.
pub(super) fn bits_warning(bits: u8) -> String {
    format!(
        "the frames have files of 16 bits, but no value of more than {bits} bits, and are read \
         so; bits = {bits} under [frames] confirms it, and saves looking at all of them"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A JPEG file of 8 × 6 pixels with an EXIF orientation, 0 for none.
    fn write_jpeg(path: &Path, orientation: u8) {
        let mut bytes = Vec::new();
        let picture = image::GrayImage::new(8, 6);
        let encoder = image::codecs::jpeg::JpegEncoder::new(&mut bytes);
        picture.write_with_encoder(encoder).unwrap();
        let exif = [
            &b"\xff\xe1\0\x22Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..],
            &[orientation, 0, 0, 0, 0, 0, 0],
        ];
        if orientation > 0 {
            bytes.splice(2..2, exif.concat());
        }
        std::fs::write(path, bytes).unwrap();
    }

    /// The warning of frames with these orientations, and whether they are turned.
    fn warning(orientations: &[u8], size: (u32, u32)) -> (String, bool) {
        let dir = tempfile::tempdir().unwrap();
        for (k, orientation) in orientations.iter().enumerate() {
            write_jpeg(&dir.path().join(format!("{k}.jpg")), *orientation);
        }
        let section = FramesSection {
            images: Some("*.jpg".to_owned()),
            ..FramesSection::default()
        };
        let toml = dir.path().join("survey.toml");
        let listed = FrameList::new(&section, &toml, dir.path(), None).unwrap();
        let (listed, warning) = listed.oriented(size, &section);
        let turned = listed.frames[0].reading().unwrap().orientation == PictureOrientation::Exif;
        (warning.unwrap_or_default(), turned)
    }

    #[test]
    fn different_orientations_are_named() {
        let (said, turned) = warning(&[0, 1, 6, 6, 3], (8, 6));
        assert!(!turned && said.contains("which is not done"), "{said}");
        assert!(said.contains("(1 of 2, 3 of 1, 6 of 2 frames)"), "{said}");
        assert!(said.contains("as ") && said.contains("2.jpg"), "{said}");
        let (said, turned) = warning(&[6, 6], (6, 8));
        assert!(turned && said.contains("EXIF orientation (6)"), "{said}");
        assert_eq!(warning(&[0, 1, 0], (8, 6)), (String::new(), false));
    }
}
