//! Record of one run, a line of runs.jsonl.

use crate::converge::sweep_cell::SweepCell;
use crate::converge::wall_deformation::WallDeformation;
use serde::{Deserialize, Serialize};

/// Version of the content of runs.jsonl and converge.json.
///
/// It changes when the meaning of a field changes.
pub const SCHEMA_VERSION: u32 = 1;

/// Settings that all runs of a sweep share; runs of different settings are never combined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Version of the line, [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name and version of the program.
    pub program: String,
    /// Number of frames of a survey.
    pub frames: usize,
    /// Width of a frame, pixels.
    pub width: u32,
    /// Height of a frame, pixels.
    pub height: u32,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
    /// Deformation of the wall; none in older logs.
    #[serde(default)]
    pub deformation: WallDeformation,
}

impl Settings {
    /// Describes the first setting in which `other` differs: "frames is 24 there and 12 here".
    pub(super) fn difference(&self, other: &Self) -> Option<String> {
        let differ = |what: &str, here: String, there: String| {
            (here != there).then(|| format!("{what} is {there} there and {here} here"))
        };
        let size = |settings: &Self| format!("{}x{}", settings.width, settings.height);
        // JSON may round the last digit.
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
        .or_else(|| {
            let deformation = |settings: &Self| settings.deformation.to_string();
            differ("the deformation", deformation(self), deformation(other))
        })
    }
}

/// One finished run, as a line of runs.jsonl.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Settings of the sweep.
    #[serde(flatten)]
    pub settings: Settings,
    /// Cell of the grid.
    #[serde(flatten)]
    pub cell: SweepCell,
    /// Requested seed.
    pub seed: u64,
    /// Seed of the first feasible draw; `None` if no draw is feasible and nothing was refined.
    pub seed_used: Option<u64>,
    /// Number of infeasible draws before it.
    pub redraws: u64,
    /// True if the refinement returned poses.
    pub refined: bool,
    /// Reason why it did not.
    pub error: Option<String>,
    /// True if every frame is good.
    pub success: bool,
    /// Largest root mean square wall error of a frame, pixels; `None` if a frame misses the wall.
    pub worst_frame_px: Option<f64>,
    /// Root mean square wall error of all frames, pixels; `None` if a frame misses the wall.
    pub rms_px: Option<f64>,
    /// Number of frames with an error below [`GOOD_PX`](super::GOOD_PX).
    pub good_frames: usize,
    /// Number of frames that the refinement flags as anything but photometric.
    pub flagged_frames: usize,
    /// Number of frames that the refinement flags as photometric although they are neither good nor
    /// within 3.5 of their stated σ.
    pub false_successes: usize,
    /// Duration of the refinement, seconds.
    pub seconds: f64,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::converge::options::ConvergeOptions;
    use crate::converge::sweep_cell::SweepWall;
    use tunnelstitch_geometry::trajectory::JitterModel;

    /// A successful run of the default sweep.
    pub fn record(rotation_deg: f64, seed: u64) -> RunRecord {
        RunRecord {
            settings: ConvergeOptions::default().settings(),
            cell: SweepCell::new(
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
