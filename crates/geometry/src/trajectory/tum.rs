//! TUM: lines `time tx ty tz qx qy qz qw`, seconds and metres, camera-to-world.
//!
//! Times of 17 digits and more are nanoseconds, as ORB-SLAM3 writes them, and a comment may name
//! another unit, as `[ms]`. Commas, semicolons and tabs may separate, and a comment before the
//! first pose may name `qw` first.
//!
//! The program's own format. It is written with eight columns, single spaces and no trailing space,
//! as `evo` requires.

use super::entry_list::ParsedPoses;
use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::pose_options::PoseFileOptions;
use super::quaternion_order::QuaternionOrder;
use super::stamped_pose::{StampedPose, Trajectory};
use super::time_unit::TimeUnit;
use super::{row, text};
use nalgebra::Vector3;
use std::borrow::Cow;
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
    let parsed = parse(path, &text::read(path)?, &PoseFileOptions::default())?;
    let entries = parsed.entries;
    if entries.is_empty() {
        return Err(PoseError::no_poses(path));
    }
    let stamped = |entry: PoseEntry| StampedPose {
        time_s: entry.time_s.unwrap_or_default(),
        pose: entry.pose,
    };
    Ok(entries.into_iter().map(stamped).collect())
}

/// Parses a TUM file; without options for the order of the quaternion and the unit of times,
/// comments name them, or they are TUM's own.
pub(super) fn parse(
    path: &Path,
    text: &str,
    options: &PoseFileOptions,
) -> Result<ParsedPoses, PoseError> {
    let order = options
        .quaternion
        .or_else(|| QuaternionOrder::of_comments(text))
        .unwrap_or_default();
    let unit = options.time_unit.or_else(|| TimeUnit::of_comments(text));
    text::stamped_lines(path, text, options.duplicate_times, |line| {
        parse_line(line, order, unit)
    })
}

fn parse_line(
    line: &str,
    order: QuaternionOrder,
    unit: Option<TimeUnit>,
) -> Result<PoseEntry, String> {
    let [time, pose @ ..]: [Cow<'_, str>; 8] = row::exact_words(line, FORM).map_err(|what| {
        let count = row::words(line).map_or(0, |words| words.len());
        let has_no_time = count + 1 == FORM.split(' ').count();
        let remedy = if has_no_time {
            "; if times are missing, a first line `tx ty tz qx qy qz qw` says so"
        } else {
            ""
        };
        format!("{what}{remedy}")
    })?;
    let mut values = [0.0; 7];
    for (value, word) in values.iter_mut().zip(&pose) {
        *value = text::number(word, FORM)?;
    }
    let [tx, ty, tz, a, b, c, d] = values;
    Ok(PoseEntry {
        camera: None,
        name: None,
        time_s: Some(
            text::time(&time, unit, FORM).map_err(|what| with_remedy_of_names(&time, what))?,
        ),
        pose: Pose::new(
            text::rotation(order.wxyz([a, b, c, d]), order.columns())?,
            Vector3::new(tx, ty, tz),
        ),
    })
}

/// The error of a time; if the word is the name of a picture, with what reads it.
fn with_remedy_of_names(word: &str, what: String) -> String {
    let is_name = Path::new(word).extension().is_some_and(|extension| {
        extension.len() > 1 && extension.to_string_lossy().starts_with(char::is_alphabetic)
    });
    if is_name {
        format!(
            "{what}; if the rows begin with names, a first line `file {}` says so",
            &FORM[5..]
        )
    } else {
        what
    }
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
