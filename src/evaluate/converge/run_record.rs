//! A line of runs.jsonl.

use super::Cell;
use serde::{Deserialize, Serialize};

/// What all runs of a sweep share; runs of other settings are not put together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// [`SCHEMA_VERSION`](super::SCHEMA_VERSION) of the line.
    pub schema_version: u32,
    /// Name and version of the program.
    pub program: String,
    /// Frames of a survey.
    pub frames: usize,
    /// Width of a frame, pixels.
    pub width: u32,
    /// Height of a frame, pixels.
    pub height: u32,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
}

impl Settings {
    /// The first setting in which `other` differs, in words: "frames is 24 there and 12 here".
    pub(super) fn difference(&self, other: &Self) -> Option<String> {
        let differ = |what: &str, here: String, there: String| {
            (here != there).then(|| format!("{what} is {there} there and {here} here"))
        };
        let size = |settings: &Self| format!("{}x{}", settings.width, settings.height);
        // A number that went through JSON may have lost its last digit.
        let noise = |settings: &Self| format!("{:.9}", settings.noise_grey);
        differ(
            "the version of the log",
            self.schema_version.to_string(),
            other.schema_version.to_string(),
        )
        .or_else(|| differ("the program", self.program.clone(), other.program.clone()))
        .or_else(|| differ("frames", self.frames.to_string(), other.frames.to_string()))
        .or_else(|| differ("size", size(self), size(other)))
        .or_else(|| differ("noise", noise(self), noise(other)))
    }
}

/// One finished run, as a line of runs.jsonl.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// What it shares with all runs of the sweep.
    #[serde(flatten)]
    pub settings: Settings,
    /// Where it lies in the grid.
    #[serde(flatten)]
    pub cell: Cell,
    /// The seed asked for.
    pub seed: u64,
    /// The seed of the survey: that one, or the first after it by which the survey could be flown;
    /// none if there is none, and then nothing was refined.
    pub seed_used: Option<u64>,
    /// Surveys drawn before that nobody could fly.
    pub redraws: u64,
    /// True if the refinement gave poses.
    pub refined: bool,
    /// Why it did not.
    pub error: Option<String>,
    /// Whether every frame is good.
    pub success: bool,
    /// Greatest root mean square wall error of a frame, pixels; none if a frame has no place on the
    /// wall.
    pub worst_frame_px: Option<f64>,
    /// Root mean square wall error of all frames, pixels; none as above.
    pub rms_px: Option<f64>,
    /// Frames off by less than [`GOOD_PX`](super::GOOD_PX).
    pub good_frames: usize,
    /// Frames that the refinement itself calls unsure: flagged as anything but photometric.
    pub flagged_frames: usize,
    /// Frames that the refinement calls photometric and that are not good.
    pub false_successes: usize,
    /// Time of the refinement, seconds.
    pub seconds: f64,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::evaluate::converge::{ConvergeOptions, SweepWall};
    use crate::trajectory::JitterModel;

    /// A run of the default sweep that went well.
    pub fn record(rotation_deg: f64, seed: u64) -> RunRecord {
        RunRecord {
            settings: ConvergeOptions::default().settings(),
            cell: Cell::new(
                JitterModel::RandomWalk,
                SweepWall::Brick,
                30.0,
                rotation_deg,
                rotation_deg / 2.0,
            ),
            seed,
            seed_used: Some(seed),
            redraws: 0,
            refined: true,
            error: None,
            success: true,
            worst_frame_px: Some(0.03),
            rms_px: Some(0.01),
            good_frames: 24,
            flagged_frames: 0,
            false_successes: 0,
            seconds: 1.5,
        }
    }

    #[test]
    fn a_line_is_read_as_it_was_written() {
        let mut run = record(0.7, 3);
        run.worst_frame_px = None;
        let line = serde_json::to_string(&run).unwrap();
        assert!(!line.contains('\n'));
        assert_eq!(serde_json::from_str::<RunRecord>(&line).unwrap(), run);
    }

    #[test]
    fn a_difference_is_named_with_both_values() {
        let here = ConvergeOptions::default().settings();
        assert_eq!(here.difference(&here), None);
        let there = Settings {
            width: 320,
            ..here.clone()
        };
        let difference = here.difference(&there).unwrap();
        assert_eq!(difference, "size is 320x480 there and 640x480 here");
    }
}
