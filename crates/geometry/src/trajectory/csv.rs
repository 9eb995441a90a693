//! CSV files with named columns: `frame,time_s,tx_m,ty_m,tz_m,qx,qy,qz,qw`, camera-to-world.
//!
//! Columns are found by name, in any order; other columns are ignored. `frame` (or `name`, `file`,
//! `filename`, `image`), a time in `time_s` (`time`, `timestamp`, `timestamp_s`) or in `time_ns`
//! (`timestamp_ns`), or both, may be missing; whole numbers of 16 digits and more are nanoseconds
//! in any of them. Positions are `tx_m` or `tx`, `x_m`, `x` and so on, metres. Commas, semicolons
//! and tabs separate; names may stand in quotes.

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::stamped_pose::StampedPose;
use super::{text, times};
use csv::{ReaderBuilder, StringRecord, WriterBuilder};
use nalgebra::Vector3;
use std::borrow::Cow;
use std::path::Path;

pub(super) const FORM: &str = "frame,time_s,tx_m,ty_m,tz_m,qx,qy,qz,qw";

/// Accepted names of each column.
const NAME: &[&str] = &["frame", "name", "file", "filename", "image"];
const TIME_S: &[&str] = &["time_s", "time", "timestamp", "timestamp_s"];
const TIME_NS: &[&str] = &["time_ns", "timestamp_ns"];
const POSE: [&[&str]; 7] = [
    &["tx_m", "tx", "x_m", "x"],
    &["ty_m", "ty", "y_m", "y"],
    &["tz_m", "tz", "z_m", "z"],
    &["qx"],
    &["qy"],
    &["qz"],
    &["qw"],
];

/// Indices of the columns.
struct Columns {
    name: Option<usize>,
    time_s: Option<usize>,
    time_ns: Option<usize>,
    pose: [usize; 7],
}

impl Columns {
    fn of(header: &StringRecord) -> Result<Self, String> {
        let find = |names: &[&str]| {
            let mut found = (0..header.len()).filter(|&k| {
                header
                    .get(k)
                    .is_some_and(|column| names.contains(&column.to_lowercase().as_str()))
            });
            match (found.next(), found.next()) {
                (first, None) => Ok(first),
                _ => Err(format!("two columns are called `{}`", names.join("`, `"))),
            }
        };
        let mut pose = [0; 7];
        for (at, names) in pose.iter_mut().zip(POSE) {
            *at = find(names)?.ok_or_else(|| {
                format!(
                    "no column `{}`; the columns are `{FORM}`",
                    names.join("` or `")
                )
            })?;
        }
        Ok(Self {
            name: find(NAME)?,
            time_s: find(TIME_S)?,
            time_ns: find(TIME_NS)?,
            pose,
        })
    }
}

/// True for a header with the columns of poses.
pub(super) fn is_header(line: &str) -> bool {
    let words = line
        .split([',', ';', '\t'])
        .map(|word| word.trim().trim_matches('"'));
    words
        .filter(|word| {
            POSE.iter()
                .any(|names| names.contains(&word.to_lowercase().as_str()))
        })
        .count()
        >= 2
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let Some((header_number, header)) = text::lines(text).next() else {
        return Ok(Vec::new());
    };
    let separator = separator(header);
    let header =
        split(header, separator).map_err(|what| PoseError::line(path, header_number, what))?;
    let columns =
        Columns::of(&header).map_err(|what| PoseError::line(path, header_number, what))?;
    let mut entries: Vec<PoseEntry> = Vec::new();
    let mut names = text::Names::default();
    for (number, line) in records(text, separator).skip(1) {
        let last_s = entries.last().and_then(|entry| entry.time_s);
        let entry = split(line, separator)
            .and_then(|record| parse_record(&record, header.len(), &columns))
            .and_then(|entry| {
                entry
                    .time_s
                    .map_or(Ok(()), |time_s| text::check_increasing(time_s, last_s))?;
                entry
                    .name
                    .as_deref()
                    .map_or(Ok(()), |name| names.add(name))?;
                Ok(entry)
            })
            .map_err(|what| PoseError::line(path, number, what))?;
        entries.push(entry);
    }
    Ok(entries)
}

/// The records with content and the 1-based numbers of their first lines, as [`text::lines`]; a
/// record goes on in the next line while a quoted field is open.
fn records(text: &str, separator: u8) -> impl Iterator<Item = (usize, &str)> {
    let mut rest = text;
    let mut number = 0;
    std::iter::from_fn(move || {
        loop {
            if rest.is_empty() {
                return None;
            }
            number += 1;
            let first = number;
            let mut end = line_end(rest);
            let is_comment = rest.trim_start().starts_with('#');
            while !is_comment && end < rest.len() && is_open(&rest[..end], separator) {
                end += line_end(&rest[end..]);
                number += 1;
            }
            let (record, after) = rest.split_at(end);
            rest = after;
            let record = record.trim();
            if !(record.is_empty() || is_comment) {
                return Some((first, record));
            }
        }
    })
}

/// Length of the first line of a text with its line break.
fn line_end(text: &str) -> usize {
    text.find('\n').map_or(text.len(), |k| k + 1)
}

/// True if a quoted field of a record is not closed.
fn is_open(record: &str, separator: u8) -> bool {
    let (mut is_quoted, mut at_start) = (false, true);
    for byte in record.trim_start().bytes() {
        if byte == b'"' && (is_quoted || at_start) {
            // A doubled quote closes the field and opens it again.
            is_quoted = !is_quoted;
            at_start = !is_quoted;
        } else {
            at_start = byte == separator;
        }
    }
    is_quoted
}

/// The separator of a table's columns, from its first line.
pub(super) fn separator(header: &str) -> u8 {
    let is_there = |separator: &u8| header.as_bytes().contains(separator);
    [b'\t', b';', b',']
        .into_iter()
        .find(is_there)
        .unwrap_or(b',')
}

/// Splits a line into columns.
pub(super) fn split(line: &str, separator: u8) -> Result<StringRecord, String> {
    let mut reader = ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(line.as_bytes());
    let mut record = StringRecord::new();
    match reader.read_record(&mut record) {
        Ok(_) => Ok(record),
        Err(error) => Err(error.to_string()),
    }
}

fn parse_record(
    record: &StringRecord,
    expected: usize,
    columns: &Columns,
) -> Result<PoseEntry, String> {
    if record.len() != expected {
        return Err(format!(
            "{} columns where the first line names {expected}",
            record.len()
        ));
    }
    let word = |column: usize| record.get(column).unwrap_or_default();
    let mut values = [0.0; 7];
    for (value, column) in values.iter_mut().zip(columns.pose) {
        *value = text::number(word(column), FORM)?;
    }
    let [tx, ty, tz, qx, qy, qz, qw] = values;
    let time_s = match (columns.time_s, columns.time_ns) {
        (Some(column), _) => {
            let seconds = text::number(word(column), FORM)?;
            Some(times::from_word(word(column)).unwrap_or(seconds))
        }
        (None, Some(column)) => Some(times::from_nanoseconds(word(column))?),
        (None, None) => None,
    };
    let name = match columns.name.map(word) {
        Some("") => return Err("the frame has no name".to_owned()),
        name => name.map(|name| name_from_cell(name).to_owned()),
    };
    Ok(PoseEntry {
        name,
        time_s,
        pose: Pose::new(
            text::rotation([qw, qx, qy, qz], "as the columns' names say")?,
            Vector3::new(tx, ty, tz),
        ),
    })
}

/// A text as a cell of a table: one that a spreadsheet would run as a formula gets an apostrophe in
/// front, and so does one that has it already; [`from_cell`] takes it away.
pub fn to_cell(text: &str) -> Cow<'_, str> {
    if is_formula(text.trim_start_matches('\'')) {
        Cow::Owned(format!("'{text}"))
    } else {
        Cow::Borrowed(text)
    }
}

/// The text of a cell that [`to_cell`] has made.
pub fn from_cell(cell: &str) -> &str {
    match cell.strip_prefix('\'') {
        Some(text) if is_formula(text.trim_start_matches('\'')) => text,
        _ => cell,
    }
}

/// True for a text that spreadsheets take for a formula.
fn is_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@', '\t', '\r'])
}

/// The name of a frame as a cell. One with blanks at an end, which readers of tables take away,
/// gets an apostrophe at both, and so does one that has them already; [`name_from_cell`] takes them
/// away.
fn name_to_cell(name: &str) -> Cow<'_, str> {
    if has_outer_blanks(name) {
        Cow::Owned(format!("'{name}'"))
    } else {
        to_cell(name)
    }
}

/// The name of a cell that [`name_to_cell`] has made.
fn name_from_cell(cell: &str) -> &str {
    let inner = cell
        .strip_prefix('\'')
        .and_then(|rest| rest.strip_suffix('\''));
    match inner {
        Some(name) if has_outer_blanks(name) => name,
        _ => from_cell(cell),
    }
}

/// True for a name with blanks at an end, within any apostrophes.
fn has_outer_blanks(name: &str) -> bool {
    let name = name.trim_matches('\'');
    name.trim() != name
}

/// Formats a CSV of poses; `names` are those of the frames.
pub fn format(names: &[String], trajectory: &[StampedPose]) -> String {
    let mut writer = WriterBuilder::new()
        // A name that begins like a comment is quoted.
        .comment(Some(b'#'))
        .from_writer(Vec::new());
    // Writing to memory cannot fail.
    let _ = writer.write_record(FORM.split(','));
    for (name, StampedPose { time_s, pose }) in names.iter().zip(trajectory) {
        let (t, q) = (&pose.t_wc, &pose.r_wc);
        let numbers = [*time_s, t.x, t.y, t.z, q.i, q.j, q.k, q.w];
        let words = std::iter::once(name_to_cell(name).into_owned())
            .chain(numbers.iter().map(f64::to_string));
        let _ = writer.write_record(words);
    }
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_of_a_frame_comes_back() {
        let names = [
            "a\n\"q\",.png",
            "=HYPERLINK(1).png",
            "'=x",
            "'plain",
            "-1",
            "# x",
            "\u{1b}[m",
            " a ",
            "' a ",
            "'b '",
            "=1 ",
            "\tc",
        ];
        let names = names.map(str::to_owned);
        let pose = Pose::identity();
        let trajectory: Vec<StampedPose> = (0..names.len())
            .map(|k| StampedPose {
                time_s: k as f64,
                pose,
            })
            .collect();
        let text = format(&names, &trajectory);
        assert!(!text.contains("\n=") && !text.contains("\n-"), "{text}");
        let read = parse(Path::new("p.csv"), &text).unwrap();
        let read: Vec<String> = read.into_iter().filter_map(|entry| entry.name).collect();
        assert_eq!(read, names);
    }

    #[test]
    fn a_quote_that_is_never_closed_is_an_error_of_its_line() {
        let text = format!("# poses\n{FORM}\n\"a,0,0,0,0,0,0,0,1\nb,1,0,0,0,0,0,0,1\n");
        let error = parse(Path::new("p.csv"), &text).unwrap_err().to_string();
        assert!(error.starts_with("p.csv:3: "), "{error}");
    }
}
