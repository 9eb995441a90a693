//! Elements of all text formats: lines, numbers, times, quaternions and names.

use super::entry_list::{DuplicateTimes, EntryList, ParsedPoses};
use super::error::PoseError;
use super::pose_entry::PoseEntry;
use super::time_unit::TimeUnit;
use super::times;
use crate::files::limits::MAX_TABLE_BYTES;
use crate::files::{decode_text, read_regular};
use nalgebra::{Quaternion, UnitQuaternion};
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;

/// Reads a text file of any encoding that [`decode_text`] knows.
///
/// # Errors
/// An unreadable file, or one that is no such text.
pub fn read(path: &Path) -> Result<String, PoseError> {
    let bytes = read_regular(path, MAX_TABLE_BYTES).map_err(|source| PoseError::Read {
        path: path.to_owned(),
        source,
    })?;
    decode_text(&bytes).map_err(|what| PoseError::file(path, what))
}

/// The lines with content and their 1-based numbers; blank lines and comments that begin with `#`
/// are skipped.
pub fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Parses the pose of each line with content.
pub(super) fn stamped_lines(
    path: &Path,
    text: &str,
    duplicates: DuplicateTimes,
    parse_line: impl Fn(&str) -> Result<PoseEntry, String>,
) -> Result<ParsedPoses, PoseError> {
    let mut entries = EntryList::new(duplicates);
    for (number, line) in lines(text) {
        parse_line(line)
            .and_then(|entry| entries.push(number, entry))
            .map_err(|what| PoseError::line(path, number, what))?;
    }
    Ok(entries.into_parsed())
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

/// Parses a time in `unit`, to seconds; without one, whole numbers of 16 digits and more are
/// nanoseconds, all others seconds. `form` describes the line for the error message.
pub(super) fn time(word: &str, unit: Option<TimeUnit>, form: &str) -> Result<f64, String> {
    number(word, form)?;
    times::from_word(word, unit)
        .ok_or_else(|| format!("`{word}` is not a time; give seconds, or whole nanoseconds"))
}

/// The number with a decimal point instead of a decimal comma, which it may have where commas do
/// not separate.
pub(super) fn with_decimal_point(word: &str, separator: u8) -> Cow<'_, str> {
    match word.split_once(',') {
        Some((whole, fraction)) if separator != b',' && !word.contains('.') => {
            let number = format!("{whole}.{fraction}");
            if number.parse::<f64>().is_ok() {
                return Cow::Owned(number);
            }
            Cow::Borrowed(word)
        }
        _ => Cow::Borrowed(word),
    }
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
