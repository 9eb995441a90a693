//! What all text formats are made of: lines, numbers, quaternions, times that increase.

use super::error::PoseError;
use super::pose_entry::PoseEntry;
use nalgebra::{Quaternion, UnitQuaternion};
use std::collections::HashSet;
use std::path::Path;

/// The text of a file, without the byte order mark that some editors begin it with.
///
/// # Errors
/// An unreadable file, or one that is no text.
pub(crate) fn read(path: &Path) -> Result<String, PoseError> {
    let bytes = std::fs::read(path).map_err(|source| PoseError::Read {
        path: path.to_owned(),
        source,
    })?;
    let text = String::from_utf8(bytes)
        .ok()
        .filter(|text| !text.contains('\0'))
        .ok_or_else(|| PoseError::file(path, "is no text (UTF-8)"))?;
    match text.strip_prefix('\u{feff}') {
        Some(rest) => Ok(rest.to_owned()),
        None => Ok(text),
    }
}

/// The lines that say something, with their 1-based numbers: neither blank nor a comment that
/// begins with `#`.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// The pose of each line that says something; `parse_line` is given the line and the time of the
/// pose before.
pub(super) fn stamped_lines(
    path: &Path,
    text: &str,
    parse_line: impl Fn(&str, Option<f64>) -> Result<PoseEntry, String>,
) -> Result<Vec<PoseEntry>, PoseError> {
    let mut entries: Vec<PoseEntry> = Vec::new();
    for (number, line) in lines(text) {
        let last_s = entries.last().and_then(|entry| entry.time_s);
        let entry = parse_line(line, last_s).map_err(|what| PoseError::line(path, number, what))?;
        entries.push(entry);
    }
    Ok(entries)
}

/// A finite number; `form` says what the line should look like.
pub(crate) fn number(word: &str, form: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!(
            "`{word}` is not finite; remove the frame or give it a pose"
        )),
        Err(_) => Err(format!("`{word}` is not a number; a pose is `{form}`")),
    }
}

/// A finite number of a table that is not one of poses.
pub(crate) fn finite(word: &str) -> Result<f64, String> {
    let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| format!("`{word}` is no finite number"))
}

/// Exactly N numbers with blanks between; `form` says what they are.
pub(crate) fn numbers<const N: usize>(line: &str, form: &str) -> Result<[f64; N], String> {
    let values = line
        .split_whitespace()
        .map(|word| number(word, form))
        .collect::<Result<Vec<f64>, String>>()?;
    let count = values.len();
    <[f64; N]>::try_from(values).map_err(|_| format!("{count} columns where `{form}` has {N}"))
}

/// The rotation of a quaternion; `order` is that of its numbers in the file.
///
/// Up to 1 % off unit length is taken for rounding and put right.
pub(crate) fn rotation([w, x, y, z]: [f64; 4], order: &str) -> Result<UnitQuaternion<f64>, String> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if norm < 1e-6 {
        return Err(
            "the quaternion is zero; no rotation at all is qw = 1, qx = qy = qz = 0".into(),
        );
    }
    if (norm - 1.0).abs() > 0.01 {
        return Err(format!(
            "the quaternion has length {norm:.4}, not 1; the order is {order}"
        ));
    }
    // One that is of unit length to rounding stays to the bit, so that what is written and read
    // again is the same.
    if (norm - 1.0).abs() <= 4.0 * f64::EPSILON {
        return Ok(UnitQuaternion::new_unchecked(quaternion));
    }
    Ok(UnitQuaternion::from_quaternion(quaternion))
}

/// Checks that times increase.
pub(crate) fn check_increasing(time_s: f64, last_s: Option<f64>) -> Result<(), String> {
    match last_s {
        Some(last) if time_s == last => Err(format!(
            "duplicate timestamp {time_s}: every pose needs a time of its own"
        )),
        Some(last) if time_s < last => Err(format!(
            "timestamp {time_s} after {last}: sort the file by time"
        )),
        _ => Ok(()),
    }
}

/// Frames' names that were met, each of which may come once.
#[derive(Default)]
pub(crate) struct Names(HashSet<String>);

impl Names {
    /// Adds a name.
    pub(crate) fn add(&mut self, name: &str) -> Result<(), String> {
        if self.0.insert(name.to_owned()) {
            Ok(())
        } else {
            Err(format!("a second pose of {name}; a frame has one"))
        }
    }
}
