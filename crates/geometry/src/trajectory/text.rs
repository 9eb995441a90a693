//! Elements of all text formats: lines, numbers, quaternions and increasing times.

use super::error::PoseError;
use super::pose_entry::PoseEntry;
use crate::files::limits::MAX_TABLE_BYTES;
use crate::files::read_regular;
use nalgebra::{Quaternion, UnitQuaternion};
use std::collections::HashSet;
use std::path::Path;

/// Reads a text file and removes its byte order mark.
///
/// # Errors
/// An unreadable file, or one that is not UTF-8 text.
pub fn read(path: &Path) -> Result<String, PoseError> {
    let bytes = read_regular(path, MAX_TABLE_BYTES).map_err(|source| PoseError::Read {
        path: path.to_owned(),
        source,
    })?;
    let text = String::from_utf8(bytes)
        .ok()
        .filter(|text| !text.contains('\0'))
        .ok_or_else(|| PoseError::file(path, "is not UTF-8 text"))?;
    match text.strip_prefix('\u{feff}') {
        Some(rest) => Ok(rest.to_owned()),
        None => Ok(text),
    }
}

/// The lines with content and their 1-based numbers; blank lines and comments that begin with `#`
/// are skipped.
pub fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Parses the pose of each line with content; `parse_line` receives the line and the time of the
/// previous pose.
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

/// Parses a finite number; `form` describes the line for the error message.
pub fn number(word: &str, form: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!(
            "`{word}` is not finite; remove the frame or give it a pose"
        )),
        Err(_) => Err(format!("`{word}` is not a number; a pose is `{form}`")),
    }
}

/// Parses a finite number of a table other than a pose file.
pub fn finite(word: &str) -> Result<f64, String> {
    let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| format!("`{word}` is not a finite number"))
}

/// Parses exactly N blank-separated numbers; `form` describes them for the error message.
pub fn numbers<const N: usize>(line: &str, form: &str) -> Result<[f64; N], String> {
    let values = line
        .split_whitespace()
        .map(|word| number(word, form))
        .collect::<Result<Vec<f64>, String>>()?;
    let count = values.len();
    <[f64; N]>::try_from(values).map_err(|_| format!("{count} columns where `{form}` has {N}"))
}

/// The rotation of a quaternion; `order` is the order of its numbers in the file, for the error
/// message.
///
/// A deviation of up to 1 % from unit length is treated as rounding and normalised.
pub fn rotation([w, x, y, z]: [f64; 4], order: &str) -> Result<UnitQuaternion<f64>, String> {
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
    // A quaternion of unit length to rounding stays bit for bit, so that writing and reading is
    // lossless.
    if (norm - 1.0).abs() <= 4.0 * f64::EPSILON {
        return Ok(UnitQuaternion::new_unchecked(quaternion));
    }
    Ok(UnitQuaternion::from_quaternion(quaternion))
}

/// Checks that times increase.
pub fn check_increasing(time_s: f64, last_s: Option<f64>) -> Result<(), String> {
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

/// The set of frame names read so far, to reject duplicates.
#[derive(Default)]
pub struct Names(HashSet<String>);

impl Names {
    /// Adds a name.
    pub fn add(&mut self, name: &str) -> Result<(), String> {
        if self.0.insert(name.to_owned()) {
            Ok(())
        } else {
            Err(format!("a second pose of {name}; a frame has one"))
        }
    }
}
