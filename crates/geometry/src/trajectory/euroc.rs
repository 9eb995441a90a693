//! EuRoC: `timestamp [ns], x, y, z, qw, qx, qy, qz, …`, poses of the **body** (IMU) in the world.
//!
//! The first eight columns count; velocities and biases may follow. Read only. Source: Burri et
//! al., "The EuRoC micro aerial vehicle datasets", 2016.

use super::entry_list::{DuplicateTimes, ParsedPoses};
use super::error::PoseError;
use super::nanoseconds::from_nanoseconds;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::{text, times};
use nalgebra::Vector3;
use std::path::Path;

const FORM: &str = "timestamp [ns], x, y, z, qw, qx, qy, qz";

/// True for a line of such a file: comma-separated, with a first number that has the digits of
/// nanoseconds since 1970, or more digits than any other time.
pub(super) fn is_line(line: &str) -> bool {
    let mut words = line.split(',');
    let time = words.next().unwrap_or_default().trim();
    time.len() >= times::MIN_NANOSECOND_DIGITS
        && time.bytes().all(|byte| byte.is_ascii_digit())
        && words.count() >= 7
}

pub(super) fn parse(
    path: &Path,
    text: &str,
    duplicates: DuplicateTimes,
) -> Result<ParsedPoses, PoseError> {
    text::stamped_lines(path, text, duplicates, parse_line)
}

fn parse_line(line: &str) -> Result<PoseEntry, String> {
    let words: Vec<&str> = line.split(',').map(str::trim).collect();
    let [time, pose @ ..] = words.as_slice() else {
        return Err(format!("no columns where `{FORM}` has 8"));
    };
    if pose.len() < 7 {
        return Err(format!("{} columns where `{FORM}` has 8", words.len()));
    }
    let time_s = from_nanoseconds(time)?;
    let mut values = [0.0; 7];
    for (value, word) in values.iter_mut().zip(pose) {
        *value = text::number(word, FORM)?;
    }
    let [x, y, z, qw, qx, qy, qz] = values;
    Ok(PoseEntry {
        camera: None,
        name: None,
        time_s: Some(time_s),
        pose: Pose::new(
            text::rotation([qw, qx, qy, qz], "qw qx qy qz")?,
            Vector3::new(x, y, z),
        ),
    })
}
