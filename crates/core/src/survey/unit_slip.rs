//! Units of times in which poses and frames fit each other where they do not as given.

use super::associate::{TimeAssociation, by_time};
use crate::frames::FrameFile;
use std::fmt;
use tunnelstitch_geometry::trajectory::{PoseFile, TimeUnit};

/// Time between consecutive frames of a camera, seconds. It tells units that fit each other from
/// those that are both wrong by the same factor.
const USUAL_STEP_S: std::ops::RangeInclusive<f64> = 0.001..=10.0;
/// Smallest number of poses that frames must be associated with: in a unit that is too large, all
/// frames are at one pose.
const MIN_POSES: usize = 3;

/// The times of poses and of frames in some units; [`None`] where they cannot be read so.
pub(super) struct ClockReading {
    /// The poses with their times.
    pub poses: Option<PoseFile>,
    /// Times of the frames, seconds.
    pub frames: Option<Vec<f64>>,
}

/// Units other than given; [`None`]: as given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct UnitSlip {
    poses: Option<TimeUnit>,
    frames: Option<TimeUnit>,
}

impl UnitSlip {
    /// Finds the units in which every frame has its pose: those with a usual time between frames
    /// first, then those that change one of the two files only.
    pub fn find(
        given: ClockReading,
        frames: &[FrameFile],
        how: TimeAssociation,
        poses_in: impl Fn(TimeUnit) -> Option<PoseFile>,
        frames_in: impl Fn(TimeUnit) -> Option<Vec<f64>>,
    ) -> Option<Self> {
        let is_read = given.frames.is_some();
        let units = || TimeUnit::ALL.into_iter();
        let given_and = |value, others: Vec<_>| std::iter::once((None, value)).chain(others);
        let poses: Vec<(Option<TimeUnit>, Option<PoseFile>)> = given_and(
            given.poses,
            units().map(|unit| (Some(unit), poses_in(unit))).collect(),
        )
        .collect();
        let mut best: Option<((bool, usize), Self)> = None;
        let times = std::iter::once((None, given.frames))
            .chain(units().map(|unit| (Some(unit), frames_in(unit))));
        for (frame_unit, times_s) in times {
            let Some(times_s) = times_s else { continue };
            for (pose_unit, file) in &poses {
                let slip = Self {
                    poses: *pose_unit,
                    frames: frame_unit,
                };
                // Other units of both change nothing, unless only these can be read.
                let is_same = is_read && slip.poses == slip.frames;
                let Some(file) = file.as_ref().filter(|_| !is_same) else {
                    continue;
                };
                let is_usual = USUAL_STEP_S.contains(&step_s(&times_s));
                let rank = (!is_usual, slip.changes());
                let is_better = best.is_none_or(|(of_best, _)| rank < of_best);
                if is_better && fit(file, frames, &times_s, how) {
                    best = Some((rank, slip));
                }
            }
        }
        best.map(|(_, slip)| slip)
    }

    /// Number of files that are read in another unit.
    fn changes(&self) -> usize {
        usize::from(self.poses.is_some()) + usize::from(self.frames.is_some())
    }
}

impl fmt::Display for UnitSlip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = |unit: TimeUnit, of: &str, section: &str| {
            format!(
                "those of the {of} as {} (time_unit = \"{}\" under [{section}] of survey.toml)",
                unit.plural(),
                unit.name()
            )
        };
        let poses = self.poses.map(|unit| line(unit, "poses", "poses"));
        let frames = self.frames.map(|unit| line(unit, "frames", "frames"));
        let lines: Vec<String> = poses.into_iter().chain(frames).collect();
        write!(
            f,
            "its times and those of the frames do not fit each other in the units taken, but do \
             with {}",
            lines.join(" and ")
        )
    }
}

/// Mean time between consecutive frames, seconds.
fn step_s(times_s: &[f64]) -> f64 {
    match times_s {
        [first, .., last] => (last - first) / (times_s.len() - 1) as f64,
        _ => 0.0,
    }
}

/// True if every frame has its pose, within the time between frames, and these are several.
fn fit(file: &PoseFile, frames: &[FrameFile], times_s: &[f64], how: TimeAssociation) -> bool {
    let how = TimeAssociation {
        tolerance_s: how.tolerance_s.min(step_s(times_s)),
        ..how
    };
    let poses_s: Vec<f64> = file
        .entries
        .iter()
        .filter_map(|entry| entry.time_s)
        .collect();
    let mut places: Vec<usize> = times_s
        .iter()
        .map(|time_s| poses_s.partition_point(|pose_s| pose_s < time_s))
        .collect();
    places.dedup();
    places.len() >= MIN_POSES.min(frames.len()) && by_time(file, frames, times_s, how).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::{PoseEntry, PoseFormat, spiral};

    const COUNT: usize = 12;

    /// Poses at these times.
    fn poses(times_s: Vec<f64>) -> PoseFile {
        let poses = spiral(times_s.len(), 0.1, 0.5);
        let entry = |(time_s, pose)| PoseEntry {
            camera: None,
            name: None,
            time_s: Some(time_s),
            pose,
        };
        PoseFile {
            path: "poses.tum".into(),
            format: PoseFormat::Tum,
            entries: times_s.into_iter().zip(poses).map(entry).collect(),
            conflicts: Vec::new(),
        }
    }

    /// The slip where true times are written in two units and both are taken for seconds; poses
    /// start `offset_s` later.
    fn slip(
        of_poses: TimeUnit,
        of_frames: TimeUnit,
        step_s: f64,
        offset_s: f64,
    ) -> Option<UnitSlip> {
        let frame = |k: usize| FrameFile::picture(k, format!("{k}.png").into());
        let frames: Vec<FrameFile> = (0..COUNT).map(frame).collect();
        let per_second = |unit: TimeUnit| 1.0 / unit.seconds("1").unwrap();
        let written = |unit: TimeUnit, offset_s: f64| -> Vec<f64> {
            let times = (0..COUNT).map(|k| (k as f64 * step_s + offset_s) * per_second(unit));
            times.map(f64::round).collect()
        };
        let in_unit = |times: &[f64], unit: TimeUnit| -> Vec<f64> {
            times.iter().map(|time| time / per_second(unit)).collect()
        };
        let (pose_times, frame_times) = (written(of_poses, offset_s), written(of_frames, 0.0));
        let given = ClockReading {
            poses: Some(poses(pose_times.clone())),
            frames: Some(frame_times.clone()),
        };
        let how = TimeAssociation {
            tolerance_s: 0.01,
            interpolate: false,
        };
        let poses_in = |unit| Some(poses(in_unit(&pose_times, unit)));
        let frames_in = |unit| Some(in_unit(&frame_times, unit));
        UnitSlip::find(given, &frames, how, poses_in, frames_in)
    }

    #[test]
    fn all_pairs_of_units_are_told() {
        for of_poses in TimeUnit::ALL {
            for of_frames in TimeUnit::ALL {
                if of_poses == of_frames {
                    continue;
                }
                let found = slip(of_poses, of_frames, 2.0, 0.0);
                // Seconds are as given.
                let other = |unit: TimeUnit| (unit != TimeUnit::S).then_some(unit);
                let expected = UnitSlip {
                    poses: other(of_poses),
                    frames: other(of_frames),
                };
                assert_eq!(found, Some(expected), "{of_poses:?} {of_frames:?}");
            }
        }
        let said = slip(TimeUnit::Ms, TimeUnit::Ns, 2.0, 0.0)
            .unwrap()
            .to_string();
        assert!(
            said.contains("poses as milliseconds (time_unit = \"ms\" under [poses]")
                && said.contains("frames as nanoseconds (time_unit = \"ns\" under [frames]"),
            "{said}"
        );
    }

    /// Clocks that do not start together are no slip of units.
    #[test]
    fn an_offset_is_no_unit() {
        for offset_s in [4.0, 1.0, 1e6, 1.4e9] {
            assert_eq!(
                slip(TimeUnit::S, TimeUnit::S, 2.0, offset_s),
                None,
                "{offset_s}"
            );
        }
    }
}
