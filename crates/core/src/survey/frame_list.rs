//! Listing of the frames that `[frames]` names.

use super::error::SurveyError;
use super::file::FramesSection;
use super::frame_times;
use crate::frames::{self, FrameFile, PictureOrientation, PictureReading, RecordedImages, Video};
use std::path::Path;
use std::sync::Arc;
use tunnelstitch_geometry::files::printed;

/// The frames that a `[frames]` section names.
pub(super) struct FrameList {
    /// The frames, sorted by name or time.
    pub frames: Vec<FrameFile>,
    /// Times of the frames, seconds, if given by a file, a video or a recording.
    pub times_s: Option<Vec<f64>>,
    /// The video that contains the frames, if any.
    pub video: Option<Arc<Video>>,
}

/// The reading of picture files that a section asks for.
///
/// # Errors
/// A number of bits that no file has, in words.
fn picture_reading(section: &FramesSection) -> Result<PictureReading, &'static str> {
    let bits = section.bits.unwrap_or(16);
    if !(9..=16).contains(&bits) {
        return Err("frames.bits must be between 9 and 16; files of 8 bits need none");
    }
    Ok(PictureReading {
        white: u16::MAX >> (16 - bits),
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

impl FrameList {
    /// Finds the frames that the section of the survey at `toml_path` names, relative to its
    /// `folder`. `frame_times`: a file of their times, instead of the survey's. A mask in the same
    /// folder is not a frame.
    ///
    /// # Errors
    /// No pictures, video or recording, or more than one; a malformed pattern, no frames, a video
    /// or recording that cannot be read, a malformed file of times.
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
                let listed = frames::list_frames(folder, pattern, mask.as_deref())?;
                Self::of_images(listed, reading)
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
            listing.times_s = Some(frame_times::read(path, &listing.frames)?);
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
    /// name an orientation. A section that says which is followed without a word.
    pub fn oriented(mut self, size: (u32, u32), section: &FramesSection) -> (Self, Option<String>) {
        // A file that cannot be read is an error of its own.
        let first = match section.orientation {
            Some(_) => None,
            None => self.frames.iter().find(|frame| frame.size().is_ok()),
        };
        let named = first.and_then(|first| Some((first, first.exif_orientation().ok()??)));
        let Some((first, number)) = named else {
            return (self, None);
        };
        let file = printed(first.file()).to_string();
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
        (self, Some(orientation_warning(&file, number, is_turned)))
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

/// The warning that pictures whose EXIF data name an orientation are turned, or that they are not.
fn orientation_warning(file: &str, number: u8, is_turned: bool) -> String {
    let named = format!(
        "{file}: by its EXIF orientation ({number}) it is to be turned or mirrored for display"
    );
    if is_turned {
        format!(
            "{named}, which is done, since the calibration fits only that; the poses must be \
             those of the camera turned likewise; orientation = \"exif\" under [frames] confirms \
             it"
        )
    } else {
        format!(
            "{named}, which is not done, since the calibration fits the pictures as they are \
             stored; if the camera was calibrated with turned pictures, add orientation = \
             \"exif\" under [frames], otherwise orientation = \"stored\""
        )
    }
}
