//! The header of a table of poses.

use super::pose_column::{ColumnMap, PoseColumn};
use super::table::{records, separator, separator_or_blank, split};
use super::title::Title;
use crate::trajectory::text;

/// The header of a table.
#[derive(Clone, Copy)]
pub(crate) struct Header<'a> {
    /// 1-based number of its line.
    pub number: usize,
    /// The names of the columns, with separators.
    pub line: &'a str,
    /// The separator of the columns.
    pub separator: u8,
}

/// Smallest number of columns of poses that a header names.
const MIN_POSE_COLUMNS: usize = 2;

impl<'a> Header<'a> {
    /// Finds the header of a table of poses: its first line with content after a `sep=;`, or the
    /// comment before it, if that has as many columns. `None` if neither names columns of poses.
    pub fn find(text: &'a str, map: &ColumnMap) -> Option<Self> {
        let first = Self::first_line(text)?;
        if is_header(first.line, first.separator, map) {
            return Some(first);
        }
        let comments = text.lines().enumerate().take(first.number - 1);
        let (index, comment) = comments
            .filter_map(|(index, line)| Some((index, line.trim().strip_prefix('#')?)))
            .last()?;
        let line = comment.trim_start_matches('#').trim();
        let separator = separator(line);
        let count = |line| split(line, separator).map_or(0, |record| record.len());
        let is_found = is_header(line, separator, map) && count(line) == count(first.line);
        is_found.then_some(Self {
            number: index + 1,
            line,
            separator,
        })
    }

    /// The first line with content after a `sep=;`, with the separator that it or that line has.
    pub fn first_line(text: &'a str) -> Option<Self> {
        let mut lines = text::lines(text);
        let (mut number, mut line) = lines.next()?;
        let named = named_separator(line);
        if named.is_some() {
            (number, line) = lines.next()?;
        }
        Some(Self {
            number,
            line,
            separator: named.unwrap_or_else(|| separator_or_blank(line)),
        })
    }

    /// The records after the header and the 1-based numbers of their first lines.
    pub(super) fn records(self, text: &'a str) -> impl Iterator<Item = (usize, &'a str)> {
        records(text, self.separator).filter(move |(number, _)| *number > self.number)
    }
}

/// True for a line with names of columns of poses.
fn is_header(line: &str, separator: u8, map: &ColumnMap) -> bool {
    let Ok(record) = split(line, separator) else {
        return false;
    };
    let is_pose = |text: &&str| {
        let title = Title::of(text);
        let mut pose = (PoseColumn::TRANSLATION.into_iter()).chain(PoseColumn::QUATERNION);
        map.values().any(|name| name == text) || pose.any(|column| title.rank(column).is_some())
    };
    record.iter().filter(is_pose).count() >= MIN_POSE_COLUMNS
}

/// The separator that a line `sep=;` names.
fn named_separator(line: &str) -> Option<u8> {
    let line = line.trim_matches('"');
    let (key, value) = line.split_at_checked("sep=".len())?;
    match value.as_bytes() {
        _ if !key.eq_ignore_ascii_case("sep=") => None,
        // The line is trimmed.
        [] => Some(b'\t'),
        [separator] if separator.is_ascii_punctuation() => Some(*separator),
        _ => None,
    }
}
