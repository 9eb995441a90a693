//! Listing of the frames that `[frames]` names.

use super::error::SurveyError;
use super::file::FramesSection;
use super::frame_times;
use crate::frames::{self, FrameFile, PictureOrientation, PictureReading, Video};
use std::path::Path;
use std::sync::Arc;
use tunnelstitch_geometry::files::printed;

/// The frames that a `[frames]` section names.
pub(super) struct FrameList {
    /// The frames, sorted by name or time.
    pub frames: Vec<FrameFile>,
    /// Times of the frames, seconds, if given by a file or a video.
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

impl FrameList {
    /// Finds the frames that the section of the survey at `toml_path` names, relative to its
    /// `folder`. `frame_times`: a file of their times, instead of the survey's. A mask in the same
    /// folder is not a frame.
    ///
    /// # Errors
    /// Neither pictures nor a video, or both; a malformed pattern, no frames, a video that cannot
    /// be read, a malformed file of times.
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
        let mut listing = match (&section.images, &section.video, section.every) {
            (Some(_), None, None) if section.angle_step_deg.is_some() => {
                return fail(
                    "frames.angle_step_deg goes with frames.video; for pictures, let \
                     frames.images match fewer of them",
                );
            }
            (Some(pattern), None, None) => {
                let mask = section.mask.as_ref().map(|mask| folder.join(mask));
                let reading = picture_reading(section).map_err(value)?;
                let listed = frames::list_frames(folder, pattern, mask.as_deref())?;
                let read = listed.into_iter().map(|frame| frame.with_reading(reading));
                Self {
                    frames: read.collect(),
                    times_s: None,
                    video: None,
                }
            }
            (None, Some(_), _) if section.skip_bad == Some(true) => {
                return fail(
                    "frames.skip_bad goes with frames.images; the pictures of a video cannot be \
                     left out singly",
                );
            }
            (None, Some(_), _) if section.bits.is_some() || section.orientation.is_some() => {
                return fail(
                    "frames.bits and frames.orientation go with frames.images; videos tell both \
                     themselves",
                );
            }
            (None, Some(_), Some(0)) => {
                return fail(
                    "frames.every is 0; 1 takes every picture of the video, 2 every other one",
                );
            }
            (None, Some(video), every) => {
                let video = Arc::new(Video::open(&folder.join(video))?);
                Self::of_video(video, every.unwrap_or(1))
            }
            (Some(_), None, Some(_)) => {
                return fail(
                    "frames.every goes with frames.video; for pictures, let frames.images match \
                     fewer of them",
                );
            }
            (None, None, _) => {
                return fail(
                    "frames has neither images (a pattern, as \"frames/*.jpg\") nor video (a file)",
                );
            }
            (Some(_), Some(_), _) => {
                return fail("frames has both images and video; take one away");
            }
        };
        let own = section.times.as_ref().map(|times| folder.join(times));
        if let Some(path) = frame_times.or(own.as_deref()) {
            listing.times_s = Some(frame_times::read(path, &listing.frames)?);
        }
        Ok(listing)
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
