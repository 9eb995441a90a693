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
    let mut lines = text::lines(text);
    let Some((header_number, header)) = lines.next() else {
        return Ok(Vec::new());
    };
    let separator = separator(header);
    let header =
        split(header, separator).map_err(|what| PoseError::line(path, header_number, what))?;
    let columns =
        Columns::of(&header).map_err(|what| PoseError::line(path, header_number, what))?;
    let mut entries: Vec<PoseEntry> = Vec::new();
    let mut names = text::Names::default();
    for (number, line) in lines {
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
        name => name.map(str::to_owned),
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

/// Formats a CSV of poses; `names` are those of the frames.
pub fn format(names: &[String], trajectory: &[StampedPose]) -> String {
    let mut writer = WriterBuilder::new().from_writer(Vec::new());
    // Writing to memory cannot fail.
    let _ = writer.write_record(FORM.split(','));
    for (name, StampedPose { time_s, pose }) in names.iter().zip(trajectory) {
        let (t, q) = (&pose.t_wc, &pose.r_wc);
        let numbers = [*time_s, t.x, t.y, t.z, q.i, q.j, q.k, q.w];
        let words = std::iter::once(name.clone()).chain(numbers.iter().map(f64::to_string));
        let _ = writer.write_record(words);
    }
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}
