//! TUM: lines `time tx ty tz qx qy qz qw`, seconds and metres, camera-to-world.
//!
//! The program's own format. It is written with eight columns, single spaces and no trailing space,
//! as `evo` requires.

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::stamped_pose::{StampedPose, Trajectory};
use super::text;
use nalgebra::Vector3;
use std::fmt::Write;
use std::path::Path;

pub(super) const FORM: &str = "time tx ty tz qx qy qz qw";

/// Reads a TUM file.
///
/// # Errors
/// An unreadable file; a line without exactly eight numbers; a number that is not finite; a
/// quaternion of length zero (or farther than 1 % from unit length); times that do not increase; no
/// pose at all.
pub fn read(path: &Path) -> Result<Trajectory, PoseError> {
    let entries = parse(path, &text::read(path)?)?;
    if entries.is_empty() {
        return Err(PoseError::file(path, "holds no poses"));
    }
    let stamped = |entry: PoseEntry| StampedPose {
        time_s: entry.time_s.unwrap_or_default(),
        pose: entry.pose,
    };
    Ok(entries.into_iter().map(stamped).collect())
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    text::stamped_lines(path, text, parse_line)
}

fn parse_line(line: &str, last_s: Option<f64>) -> Result<PoseEntry, String> {
    let [time_s, tx, ty, tz, qx, qy, qz, qw] = text::numbers(line, FORM)?;
    text::check_increasing(time_s, last_s)?;
    let rotation = text::rotation([qw, qx, qy, qz], "qx qy qz qw")?;
    Ok(PoseEntry {
        name: None,
        time_s: Some(time_s),
        pose: Pose::new(rotation, Vector3::new(tx, ty, tz)),
    })
}

/// Formats a TUM file; every number has the digits that restore it exactly.
pub fn format(trajectory: &[StampedPose]) -> String {
    let mut text = String::new();
    for StampedPose { time_s, pose } in trajectory {
        let (t, q) = (&pose.t_wc, &pose.r_wc);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{time_s} {} {} {} {} {} {} {}",
            t.x, t.y, t.z, q.i, q.j, q.k, q.w
        );
    }
    text
}
