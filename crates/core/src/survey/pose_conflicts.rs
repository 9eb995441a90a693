//! Contradicting poses of one time, judged by the frames that they belong to.

use super::associate::TimeAssociation;
use super::error::SurveyError;
use crate::frames::FrameFile;
use std::collections::HashMap;
use std::path::Path;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::recordings::is_recording;
use tunnelstitch_geometry::trajectory::{Jitter, PoseConflict, PoseEntry, PoseFile};

/// Largest contradiction at a frame, standard deviations of the prior: the pose that is kept may
/// be as wrong as any other initial pose.
const MAX_SIGMAS: f64 = 3.0;

/// Two poses of one time, and the first frame that depends on the one that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrameConflict {
    conflict: PoseConflict,
    frame: Option<usize>,
    /// Length of the file's unit, metres.
    unit_m: f64,
}

/// The contradictions of a file whose poses belong to the frames at `times_s`.
pub(super) fn frame_conflicts(
    file: &PoseFile,
    times_s: &[f64],
    how: TimeAssociation,
    unit_m: f64,
) -> Vec<FrameConflict> {
    let mut first_frame: HashMap<usize, usize> = HashMap::new();
    for (frame, time_s) in times_s.iter().enumerate() {
        for entry in entries_of_frame(file, *time_s, how) {
            first_frame.entry(entry).or_insert(frame);
        }
    }
    let conflicts = file.conflicts.iter();
    let with_frame = conflicts.map(|conflict| FrameConflict {
        conflict: *conflict,
        frame: first_frame.get(&conflict.entry).copied(),
        unit_m,
    });
    with_frame.collect()
}

/// The poses that the pose of a frame at `time_s` depends on: the nearest, or the two between which
/// is interpolated.
fn entries_of_frame(
    file: &PoseFile,
    time_s: f64,
    how: TimeAssociation,
) -> impl Iterator<Item = usize> {
    let time = |entry: usize| file.entries.get(entry)?.time_s;
    let is_before = |entry: &PoseEntry| entry.time_s.is_some_and(|other| other < time_s);
    let next = file.entries.partition_point(is_before);
    let last = next.checked_sub(1);
    let off = |entry: Option<usize>| {
        let time = entry.and_then(time);
        time.map_or(f64::INFINITY, |time| (time - time_s).abs())
    };
    let nearest = if off(last) <= off(Some(next)) {
        last
    } else {
        Some(next)
    };
    let is_between = how.interpolate && off(nearest) > 0.0;
    let entries = if is_between {
        [last, Some(next)]
    } else {
        [nearest, None]
    };
    entries.into_iter().flatten()
}

/// The warning about contradictions that the prior covers, if there are any.
///
/// # Errors
/// A frame that depends on a pose whose contradiction is more than the prior holds.
pub(super) fn check(
    path: &Path,
    frames: &[FrameFile],
    conflicts: &[FrameConflict],
    prior: &Jitter,
) -> Result<Option<String>, SurveyError> {
    let [x, y, z] = prior.translation_sigma_m;
    let max_m = MAX_SIGMAS * x.hypot(y).hypot(z);
    let max_deg = MAX_SIGMAS * prior.rotation_sigma_rad.to_degrees();
    for of_frame in conflicts {
        let PoseConflict {
            distance,
            angle_deg,
            ..
        } = of_frame.conflict;
        let is_covered = distance * of_frame.unit_m <= max_m && angle_deg <= max_deg;
        if let Some(frame) = of_frame.frame.and_then(|frame| frames.get(frame))
            && !is_covered
        {
            return Err(SurveyError::Association {
                path: path.to_owned(),
                what: format!(
                    "{}, more than [prior] allows, and frame {} ({}) depends on them; {}",
                    of_frame.description(path),
                    frame.index,
                    printed(&frame.path),
                    match is_recording(path) {
                        true => "take another topic or transform",
                        false => "remove the wrong line",
                    }
                ),
            });
        }
    }
    Ok(conflicts.first().map(|first| {
        let more = match conflicts.len() {
            1 => String::new(),
            count => format!(", and so do {} other times", count - 1),
        };
        format!(
            "{}: {}{more}; the first pose of such a time is used",
            printed(path),
            first.description(path)
        )
    }))
}

impl FrameConflict {
    fn description(&self, path: &Path) -> String {
        let PoseConflict {
            time_s,
            lines: [first, second],
            distance,
            angle_deg,
            ..
        } = self.conflict;
        let unit = match is_recording(path) {
            true => "in the order of time, messages",
            false => "lines",
        };
        format!(
            "{unit} {first} and {second} have two poses of {time_s} s, {:.2} mm and \
             {angle_deg:.3}° from each other",
            1e3 * distance * self.unit_m
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::{
        DuplicateTimes, JitterModel, PoseFileOptions, read_poses_with,
    };

    /// Poses at 0 s, 1 s (twice, 4 mm apart) and 2 s.
    fn file() -> PoseFile {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.tum");
        let text = "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n1 0 0.004 0 0 0 0 1\n2 0 0 0 0 0 0 1\n";
        std::fs::write(&path, text).unwrap();
        let options = PoseFileOptions {
            duplicate_times: DuplicateTimes::Merge,
            ..PoseFileOptions::default()
        };
        read_poses_with(&path, &options).unwrap()
    }

    fn checked(times_s: &[f64], interpolate: bool, sigma_m: f64) -> Result<String, String> {
        let file = file();
        let how = TimeAssociation {
            tolerance_s: 0.5,
            interpolate,
        };
        let frame = |(k, _)| FrameFile::picture(k, format!("{k}.png").into());
        let frames: Vec<FrameFile> = times_s.iter().enumerate().map(frame).collect();
        let prior = Jitter {
            model: JitterModel::Independent,
            rotation_sigma_rad: 0.01,
            translation_sigma_m: [0.0, sigma_m, 0.0],
        };
        let conflicts = frame_conflicts(&file, times_s, how, 1.0);
        check(Path::new("poses.tum"), &frames, &conflicts, &prior)
            .map(|warning| warning.unwrap())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn contradictions_within_the_prior_are_told() {
        let warning = checked(&[0.0, 1.0, 2.0], false, 0.002).unwrap();
        assert!(
            warning.contains("lines 2 and 3 have two poses of 1 s, 4.00 mm")
                && warning.contains("the first pose of such a time is used"),
            "{warning}"
        );
    }

    /// Only frames that depend on the time in question are refused.
    #[test]
    fn contradictions_beyond_the_prior_are_refused_at_frames() {
        for (times_s, interpolate) in [
            ([0.0, 0.9], false),
            ([0.0, 1.0], true),
            ([0.0, 0.1], true),
            ([0.0, 1.9], true),
        ] {
            let message = checked(&times_s, interpolate, 0.001).unwrap_err();
            assert!(
                message.contains("more than [prior] allows, and frame 1 (1.png) depends"),
                "{message}"
            );
        }
        for (times_s, interpolate) in [([0.0, 1.9], false), ([0.0, 2.0], true)] {
            assert!(checked(&times_s, interpolate, 0.001).is_ok());
        }
    }
}
