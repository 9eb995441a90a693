//! Elements of all text formats: lines, numbers, times, quaternions and names.

use super::entry_list::{DuplicateTimes, EntryList, ParsedPoses};
use super::error::PoseError;
use super::float::float;
use super::pose_entry::PoseEntry;
use super::time_unit::TimeUnit;
use super::times;
use crate::files::limits::MAX_TABLE_BYTES;
use crate::files::{decode_text, read_regular};
use nalgebra::{Quaternion, UnitQuaternion};
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;

/// Reads a text file of any encoding that [`decode_text`] knows, without the sign 26 that ends
/// texts of DOS.
///
/// # Errors
/// An unreadable file, or one that is no such text.
pub fn read(path: &Path) -> Result<String, PoseError> {
    let bytes = read_regular(path, MAX_TABLE_BYTES).map_err(|source| PoseError::Read {
        path: path.to_owned(),
        source,
    })?;
    let mut text = decode_text(&bytes).map_err(|what| PoseError::file(path, what))?;
    text.truncate(text.trim_end_matches('\u{1a}').len());
    Ok(with_hashed_comments(text))
}

/// The text, whose comments before the first line with content begin with `#` where they began with
/// `//`, or with `%` and a blank, as MATLAB writes them. (ROS writes `%time` without one.)
fn with_hashed_comments(text: String) -> String {
    let comment = |line: &str| {
        let line = line.trim();
        let rest = line.strip_prefix("//").or_else(|| line.strip_prefix('%'));
        let is_matlab = line.starts_with("% ") || line.starts_with("%%") || line == "%";
        rest.filter(|_| line.starts_with("//") || is_matlab)
            .map(str::to_owned)
    };
    let mut head = String::new();
    let mut rest = text.as_str();
    while let Some((line, after)) = rest.split_once('\n') {
        match comment(line) {
            Some(words) => head = head + "#" + &words,
            None if line.trim().is_empty() || line.trim().starts_with('#') => head += line,
            None => break,
        }
        head.push('\n');
        rest = after;
    }
    if head.is_empty() {
        return text;
    }
    head + rest
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
    stamped_rows(path, lines(text), duplicates, parse_line)
}

/// Parses the pose of each row, given with its 1-based number. Names and times are each there once,
/// but for the times that `duplicates` admits.
pub(super) fn stamped_rows<'t>(
    path: &Path,
    rows: impl Iterator<Item = (usize, &'t str)>,
    duplicates: DuplicateTimes,
    parse_row: impl Fn(&str) -> Result<PoseEntry, String>,
) -> Result<ParsedPoses, PoseError> {
    let mut entries = EntryList::new(duplicates);
    let mut names = Names::default();
    for (number, row) in rows {
        parse_row(row)
            .and_then(|entry| {
                entry
                    .name
                    .as_deref()
                    .map_or(Ok(()), |name| names.add(name))?;
                entries.push(number, entry)
            })
            .map_err(|what| PoseError::line(path, number, what))?;
    }
    Ok(entries.into_parsed())
}

/// Parses a finite number; `form` describes the line for the error message.
pub fn number(word: &str, form: &str) -> Result<f64, String> {
    match float(word) {
        Some(value) if value.is_finite() => Ok(value),
        Some(_) => Err(format!(
            "`{word}` is not finite; remove the frame or give it a pose"
        )),
        None if word.is_empty() => Err(format!(
            "a cell is empty; a pose is `{form}`, and rows below a table, as sums, are to be \
             deleted"
        )),
        None => Err(format!("`{word}` is not a number; a pose is `{form}`")),
    }
}

/// Parses a finite number of a table other than a pose file.
pub fn finite(word: &str) -> Result<f64, String> {
    let value = float(word).filter(|value| value.is_finite());
    value.ok_or_else(|| format!("`{word}` is not a finite number"))
}

/// Parses a time to seconds, as [`times::from_word`] does. `form` describes the line for the error
/// message.
pub(super) fn time(word: &str, unit: Option<TimeUnit>, form: &str) -> Result<f64, String> {
    if let Some(time_s) = times::from_word(word, unit) {
        return Ok(time_s);
    }
    number(word, form)?;
    Err(format!(
        "`{word}` is not a time; give seconds, or whole nanoseconds"
    ))
}

/// The number with a decimal point instead of a decimal comma, which it may have where commas do
/// not separate or it stands in quotes, and without separators of thousands.
pub(super) fn with_decimal_point(word: &str, separator: u8) -> Cow<'_, str> {
    if let Some(number) = without_thousands(word) {
        return Cow::Owned(number);
    }
    match word.split_once(',') {
        Some((whole, fraction))
            if !word.contains('.') && (separator != b',' || is_decimal(whole, fraction)) =>
        {
            let number = format!("{whole}.{fraction}");
            if float(&number).is_some() {
                return Cow::Owned(number);
            }
            Cow::Borrowed(word)
        }
        _ => Cow::Borrowed(word),
    }
}

/// True for a decimal comma in a quoted cell, where it cannot be a separator of thousands.
fn is_decimal(whole: &str, fraction: &str) -> bool {
    fraction.len() != 3 || whole.trim_start_matches(['-', '+', '−']) == "0"
}

/// The number with a decimal point alone, if points and commas are in it: the last of them is
/// decimal, and the others stand before groups of three digits, as in `1.234,5` and `1,234.5`.
fn without_thousands(word: &str) -> Option<String> {
    let (whole, decimals) = word.split_at(word.rfind(['.', ','])?);
    let mark = if decimals.starts_with(',') { '.' } else { ',' };
    let mut groups = whole.split(mark);
    let first = groups.next()?.trim_start_matches(['-', '+', '−']);
    let mut others = groups.peekable();
    others.peek()?;
    let is_number = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    let is_grouped = (1..=3).contains(&first.len())
        && is_number(first)
        && others.all(|group| group.len() == 3 && is_number(group));
    is_grouped.then(|| format!("{}.{}", whole.replace(mark, ""), &decimals[1..]))
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
            "the quaternion is zero, as some trackers write where they have lost the camera; leave \
             the line out of a file that names its frames, or leave out the frame, too".into(),
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
