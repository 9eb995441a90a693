//! Arguments of the number and the times of frames.

use super::input_file::input_file;
use super::numbers::positive;
use crate::cli::output::Failure;
use crate::survey::{FrameTimes, UnposedFrames, read_frame_times, toml_path};
use std::path::{Path, PathBuf};

/// Number and times of the frames [default: those of the survey].
#[derive(Debug, clap::Args)]
pub struct FrameTimesArguments {
    /// Number of frames, if there is no survey yet.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Frame rate, frames per second; the first frame is at 0 s [default: the survey's times, from
    /// its file of times or the frames' names].
    #[arg(long, value_name = "HZ", value_parser = positive)]
    fps: Option<f64>,
    /// File with the times of the frames, one a line: `time`, `time name` or `name time`, in
    /// seconds or whole nanoseconds.
    #[arg(long, value_name = "FILE", conflicts_with = "fps", value_parser = input_file())]
    frame_times: Option<PathBuf>,
}

impl FrameTimesArguments {
    /// Finds the times of a survey's frames, or of frames that do not exist yet.
    ///
    /// # Errors
    /// A survey without frames, a malformed file of times, times that do not increase; neither a
    /// survey nor a number of frames; two different numbers.
    pub fn find(&self, survey: Option<&Path>) -> Result<FrameTimes, Failure> {
        let (found, times_s) = match (survey, &self.frame_times) {
            (Some(survey), times) => {
                let unposed = UnposedFrames::open(survey, times.as_deref())?;
                (Some(unposed.frames.len()), unposed.times_s)
            }
            (None, Some(path)) => {
                let times_s = read_frame_times(path)?;
                (Some(times_s.len()), Some(times_s))
            }
            (None, None) => (None, None),
        };
        let given = self.frames.map(|frames| frames as usize);
        let count = match (given, found) {
            (Some(given), Some(found)) if given != found => {
                return Err(Failure::usage(format!(
                    "--frames {given}: but there are {found}; leave it out"
                )));
            }
            (Some(count), _) | (None, Some(count)) => count,
            (None, None) => {
                return Err(Failure::usage(
                    "the number of frames is unknown: name the survey, or give --frames N or \
                     --frame-times FILE",
                ));
            }
        };
        Ok(FrameTimes::new(count, self.fps, times_s)?)
    }

    /// Files that the times are read from.
    pub fn files(&self, survey: Option<&Path>) -> Vec<PathBuf> {
        let survey = survey.map(toml_path);
        survey.into_iter().chain(self.frame_times.clone()).collect()
    }
}

/// Checks that the times are seconds, since `option` needs them; returns them.
///
/// # Errors
/// No clock is known.
pub fn clock_times<'a>(frames: &'a FrameTimes, option: &str) -> Result<&'a [f64], Failure> {
    if frames.is_clock {
        Ok(&frames.times_s)
    } else {
        Err(Failure::usage(format!(
            "{option} needs the frames' times: give --fps HZ or --frame-times FILE"
        )))
    }
}
