//! How many frames there are, and when they were taken.

use super::Failure;
use super::stitch::positive;
use crate::survey::{UnposedFrames, read_frame_times, toml_path};
use std::path::{Path, PathBuf};

/// When the frames were taken [default: as the survey tells].
#[derive(Debug, clap::Args)]
pub struct FrameTimesArguments {
    /// Number of frames, where there is no survey yet.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Frames a second, the first at 0 s [default: the survey's times, from its file of times or
    /// the frames' names].
    #[arg(long, value_name = "HZ", value_parser = positive)]
    fps: Option<f64>,
    /// Times of the frames: `time`, `time name` or `name time` a line, seconds or whole
    /// nanoseconds.
    #[arg(long, value_name = "FILE", conflicts_with = "fps")]
    frame_times: Option<PathBuf>,
}

/// Times of the frames.
pub struct FrameTimes {
    /// Seconds, or their places where no clock is known; they increase.
    pub times_s: Vec<f64>,
    /// Whether they are seconds.
    pub is_clock: bool,
}

impl FrameTimesArguments {
    /// Finds the times of a survey's frames, or of frames that are not at hand.
    ///
    /// # Errors
    /// A survey whose frames cannot be found, a malformed file of times, times that do not
    /// increase; neither a survey nor a number of frames; two different numbers.
    pub fn find(&self, survey: Option<&Path>) -> Result<FrameTimes, Failure> {
        let (found, told) = match (survey, &self.frame_times) {
            (Some(survey), times) => {
                let footage = UnposedFrames::open(survey, times.as_deref())?;
                (Some(footage.frames.len()), footage.times_s)
            }
            (None, Some(path)) => {
                let times_s = read_frame_times(path)?;
                (Some(times_s.len()), Some(times_s))
            }
            (None, None) => (None, None),
        };
        let asked = self.frames.map(|frames| frames as usize);
        let count = match (asked, found) {
            (Some(asked), Some(found)) if asked != found => {
                return Err(Failure::usage(format!(
                    "--frames {asked}: but there are {found}; leave it out"
                )));
            }
            (Some(count), _) | (None, Some(count)) => count,
            (None, None) => {
                return Err(Failure::usage(
                    "how many frames? name the survey, or give --frames N or --frame-times FILE",
                ));
            }
        };
        let (times_s, is_clock) = match (self.fps, told) {
            (Some(fps), _) => ((0..count).map(|k| k as f64 / fps).collect(), true),
            (None, Some(times_s)) => (times_s, true),
            (None, None) => ((0..count).map(|k| k as f64).collect(), false),
        };
        if times_s.is_empty() {
            return Err(Failure::input("there is no frame"));
        }
        if let Some(k) = times_s.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(Failure::input(format!(
                "frame {} has time {} s, and the one before it {} s; times must increase in the order of the frames",
                k + 1,
                times_s[k + 1],
                times_s[k]
            )));
        }
        Ok(FrameTimes { times_s, is_clock })
    }

    /// The files that tell the times.
    pub fn files(&self, survey: Option<&Path>) -> Vec<PathBuf> {
        let survey = survey.map(toml_path);
        survey.into_iter().chain(self.frame_times.clone()).collect()
    }
}

impl FrameTimes {
    /// The times, if they are seconds; `what` needs them.
    ///
    /// # Errors
    /// No clock.
    pub fn clock(&self, what: &str) -> Result<&[f64], Failure> {
        if self.is_clock {
            Ok(&self.times_s)
        } else {
            Err(Failure::usage(format!(
                "{what} needs the frames' times: give --fps HZ or --frame-times FILE"
            )))
        }
    }
}
