//! The frames of a survey without poses.

use super::error::SurveyError;
use super::file::read_survey_file;
use super::frame_list::FrameList;
use super::frame_times;
use super::open::{folder_of, toml_path};
use crate::frames::FrameFile;
use std::path::Path;

/// The frames of a survey and their times, before poses are known.
#[derive(Clone, Debug)]
pub struct UnposedFrames {
    /// The frames, sorted by name; of a rig, those of its first camera, one a moment.
    pub frames: Vec<FrameFile>,
    /// Times of the frames, seconds, if given by a file, a video or all names.
    pub times_s: Option<Vec<f64>>,
}

impl UnposedFrames {
    /// Finds the frames of the survey whose folder or `survey.toml` is `path`. `frame_times`: a
    /// file of their times, instead of the survey's.
    ///
    /// # Errors
    /// A missing or malformed `survey.toml`, no frames, a malformed file of times.
    pub fn open(path: &Path, frame_times: Option<&Path>) -> Result<Self, SurveyError> {
        let toml_path = toml_path(path);
        let file = read_survey_file(&toml_path)?;
        let folder = folder_of(&toml_path);
        let FrameList {
            frames, times_s, ..
        } = FrameList::new(&file.frames_of(0), &toml_path, &folder, frame_times)?;
        let unit = file.frames.time_unit;
        let times_s = times_s.or_else(|| frame_times::from_names(&frames, unit).ok());
        Ok(Self { frames, times_s })
    }
}
