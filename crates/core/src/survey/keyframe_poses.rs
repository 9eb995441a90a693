//! Poses that are fewer than the frames, as those of a SLAM's keyframes, associated by time.

use super::associate::{TimeAssociation, by_time};
use super::error::SurveyError;
use crate::frames::FrameFile;
use tunnelstitch_geometry::trajectory::{PoseFile, StampedPose};

/// The poses of the frames that have one within the tolerance.
pub(super) fn present(
    file: &PoseFile,
    frames: &[FrameFile],
    times_s: &[f64],
    how: TimeAssociation,
) -> Vec<Option<StampedPose>> {
    let each = (0..frames.len()).map(|k| {
        let found = by_time(file, &frames[k..=k], &times_s[k..=k], how);
        found.ok().and_then(|poses| poses.first().copied())
    });
    each.collect()
}

/// The error of a frame without a pose, with the lines that interpolate those of all frames, if
/// they do.
pub(super) fn with_remedy(
    error: SurveyError,
    file: &PoseFile,
    frames: &[FrameFile],
    times_s: &[f64],
) -> SurveyError {
    let tolerance_s = farthest_s(file, times_s);
    let how = TimeAssociation {
        tolerance_s,
        interpolate: true,
    };
    match error {
        SurveyError::Association { path, what } if by_time(file, frames, times_s, how).is_ok() => {
            SurveyError::Association {
                path,
                what: format!(
                    "{what}; interpolate = true and time_tolerance_s = {tolerance_s} under [poses] \
                     interpolate between the poses"
                ),
            }
        }
        other => other,
    }
}

/// The longest time from a frame to its nearest pose, seconds, to the next hundredth.
fn farthest_s(file: &PoseFile, times_s: &[f64]) -> f64 {
    let poses = || file.entries.iter().filter_map(|entry| entry.time_s);
    let nearest = times_s.iter().map(|time_s| {
        let off = poses().map(|pose_s| (pose_s - time_s).abs());
        off.fold(f64::INFINITY, f64::min)
    });
    (100.0 * nearest.fold(0.0, f64::max)).ceil() / 100.0
}
