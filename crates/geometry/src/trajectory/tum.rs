//! TUM: lines `time tx ty tz qx qy qz qw`, seconds and metres, camera-to-world.
//!
//! Times of 17 digits and more are nanoseconds, as ORB-SLAM3 writes them, and a comment may name
//! another unit, as `[ms]`. Commas, semicolons and tabs may separate, and a comment before the
//! first pose may name `qw` first. Times may be missing; a row may have a counter before the time,
//! and the name of the frame anywhere.
//!
//! The program's own format. It is written with eight columns, single spaces and no trailing space,
//! as `evo` requires.

use super::entry_list::ParsedPoses;
use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::pose_options::PoseFileOptions;
use super::quaternion_order::QuaternionOrder;
use super::row::NamedRow;
use super::stamped_pose::{StampedPose, Trajectory};
use super::text;
use super::time_unit::TimeUnit;
use nalgebra::Vector3;
use std::fmt::Write;
use std::path::Path;

pub(super) const FORM: &str = "time tx ty tz qx qy qz qw";
/// Numbers of a pose.
const POSE: usize = 7;

/// Reads a TUM file.
///
/// # Errors
/// An unreadable file; a line without the seven numbers of a pose; a number that is not finite; a
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
    // Rows are alike: one that lacks a number is faulty, not without a time.
    let first = text::lines(text).next();
    let count = first.and_then(|(_, line)| Some(NamedRow::of(line).ok()?.words.len()));
    text::stamped_lines(path, text, options.duplicate_times, |line| {
        let row = NamedRow::of(line)?;
        if Some(row.words.len()) != count {
            return Err(wrong_count(row.words.len()));
        }
        parse_row(row, order, unit)
    })
}

/// The error of a row with that many numbers.
fn wrong_count(count: usize) -> String {
    format!("{count} columns where `{FORM}` has 8")
}

fn parse_row(
    row: NamedRow<'_>,
    order: QuaternionOrder,
    unit: Option<TimeUnit>,
) -> Result<PoseEntry, String> {
    let NamedRow { name, words } = row;
    // A counter may precede the time, or the time may be missing.
    let (before, pose) = words
        .split_at_checked(words.len().saturating_sub(POSE))
        .unwrap_or_default();
    let is_counter = |word: &str| word.parse::<u64>().is_ok();
    let time = match before {
        [] if pose.len() == POSE => None,
        [time] => Some(time),
        [counter, time] if is_counter(counter) => Some(time),
        _ => return Err(wrong_count(words.len())),
    };
    let mut values = [0.0; POSE];
    for (value, word) in values.iter_mut().zip(pose) {
        *value = text::number(word, FORM)?;
    }
    let [tx, ty, tz, a, b, c, d] = values;
    let time_s = time.map(|time| text::time(time, unit, FORM)).transpose();
    Ok(PoseEntry {
        camera: None,
        time_s: time_s.map_err(|what| with_remedy_of_names(&words[0], what))?,
        name,
        pose: Pose::new(
            text::rotation(order.wxyz([a, b, c, d]), order.columns())?,
            Vector3::new(tx, ty, tz),
        ),
    })
}

/// The error of a time; if the word is a name, with what reads it.
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
