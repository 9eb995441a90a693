//! Listing of the frames that `[frames]` names.

use super::error::SurveyError;
use super::file::FramesSection;
use super::frame_times;
use crate::frames::{self, FrameFile, Video};
use std::path::Path;
use std::sync::Arc;

/// The frames that a `[frames]` section names.
pub(super) struct FrameList {
    /// The frames, sorted by name or time.
    pub frames: Vec<FrameFile>,
    /// Times of the frames, seconds, if given by a file or a video.
    pub times_s: Option<Vec<f64>>,
    /// The video that contains the frames, if any.
    pub video: Option<Arc<Video>>,
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
        let fail = |what: &str| {
            Err(SurveyError::Value {
                path: toml_path.to_owned(),
                what: what.to_owned(),
            })
        };
        let mut listing = match (&section.images, &section.video, section.every) {
            (Some(_), None, None) if section.angle_step_deg.is_some() => {
                return fail(
                    "frames.angle_step_deg goes with frames.video; for pictures, let \
                     frames.images match fewer of them",
                );
            }
            (Some(pattern), None, None) => {
                let mask = section.mask.as_ref().map(|mask| folder.join(mask));
                Self {
                    frames: frames::list_frames(folder, pattern, mask.as_deref())?,
                    times_s: None,
                    video: None,
                }
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
