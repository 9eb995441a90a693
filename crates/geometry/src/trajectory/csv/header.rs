//! The header of a table of poses.

use super::pose_column::{ColumnMap, PoseColumn};
use super::table::{records, separator_or_blank, split};
use super::title::Title;
use crate::trajectory::float::float;
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

/// Smallest number of numbers in a row of poses: a position and a rotation.
const MIN_NUMBERS: usize = 6;

/// Columns of a rotation matrix.
const MATRIX_COLUMNS: usize = 9;

impl<'a> Header<'a> {
    /// Finds the header of a table of poses: its first line with content after a `sep=;`, or the
    /// comment before it, if that has as many columns, or a line below titles. `None` if none of
    /// them names columns of poses, or if the comment is that of TUM: a time, a translation and a
    /// quaternion, separated by blanks.
    pub fn find(text: &'a str, map: &ColumnMap) -> Option<Self> {
        let first = Self::first_line(text)?;
        if is_header(first.line, first.separator, map) {
            return Some(first);
        }
        if let Some(below) = Self::below_titles(text, map) {
            return Some(below);
        }
        let comments = text.lines().enumerate().take(first.number - 1);
        let (index, comment) = comments
            .filter_map(|(index, line)| Some((index, line.trim().strip_prefix('#')?)))
            .last()?;
        let line = comment.trim_start_matches('#').trim();
        let separator = separator_or_blank(line);
        let count = |line| split(line, separator).map_or(0, |record| record.len());
        let is_found = is_header(line, separator, map) && count(line) == count(first.line);
        let is_tum = separator == b' ' && !begins_with_pose(line);
        (is_found && !is_tum).then_some(Self {
            number: index + 1,
            line,
            separator,
        })
    }

    /// The header below lines of other words, as titles of a spreadsheet: the first that names
    /// columns of poses, if no row of numbers precedes it and a row of as many columns follows.
    fn below_titles(text: &'a str, map: &ColumnMap) -> Option<Self> {
        let mut lines = text::lines(text).peekable();
        while let Some((number, line)) = lines.next() {
            let separator = separator_or_blank(line);
            let cells = |line| split(line, separator).ok();
            let is_number = |cell: &&str| float(cell).is_some();
            let record = cells(line)?;
            if 2 * record.iter().filter(is_number).count() > record.len() {
                return None;
            }
            if is_header(line, separator, map) {
                let next = lines.peek().and_then(|(_, line)| cells(line));
                let fits = next.is_some_and(|next| next.len() == record.len());
                return fits.then_some(Self {
                    number,
                    line,
                    separator,
                });
            }
        }
        None
    }

    /// The titles of a table of numbers none of which names a column of poses; None for any other
    /// text.
    pub fn unknown_titles(text: &'a str) -> Option<Vec<&'a str>> {
        let first = Self::first_line(text)?;
        let is_number =
            |cell: &&str| float(&text::with_decimal_point(cell, first.separator)).is_some();
        let titles = split(first.line, first.separator).ok()?;
        let (_, row) = first.records(text).next()?;
        let row = split(row, first.separator).ok()?;
        let is_table = row.len() == titles.len()
            && titles.iter().all(|title| !is_number(&title))
            && row.iter().filter(is_number).count() >= MIN_NUMBERS;
        is_table.then(|| {
            let cells = first.line.split(char::from(first.separator));
            cells.map(|cell| cell.trim().trim_matches('"')).collect()
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
    let is_matrix = |text: &&str| Title::of(text).matrix_place().is_some();
    record.iter().filter(is_pose).count() >= MIN_POSE_COLUMNS
        || record.iter().filter(is_matrix).count() >= MATRIX_COLUMNS
}

/// True if a line of names separated by blanks has columns of a pose where TUM has the time, or a
/// quaternion where it has the translation.
fn begins_with_pose(line: &str) -> bool {
    let is_any = |text: &str, columns: &[PoseColumn]| {
        let title = Title::of(text);
        columns.iter().any(|column| title.rank(*column).is_some())
    };
    let mut names = line.split_whitespace();
    let first = names.next().is_some_and(|name| {
        is_any(name, &PoseColumn::TRANSLATION) || is_any(name, &PoseColumn::QUATERNION)
    });
    first
        || names
            .next()
            .is_some_and(|name| is_any(name, &PoseColumn::QUATERNION))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_in_another_language_are_listed() {
        let table = "sep=;\nBild;Rechtswert;Hochwert;H;a;b;\"c\"\n1.jpg;1,5;2;3;0,1;0;0\n";
        let expected = ["Bild", "Rechtswert", "Hochwert", "H", "a", "b", "c"];
        assert_eq!(Header::unknown_titles(table).unwrap(), expected);
        for other in [
            "a b c d e f g\n1 2 3\n",
            "1 2 3 4 5 6 7\n1 2 3 4 5 6 7\n",
            "notes\n",
            "",
        ] {
            assert_eq!(Header::unknown_titles(other), None, "{other}");
        }
    }

    /// A comment of TUM's columns leaves the file to TUM; any other order is that of a table.
    #[test]
    fn a_comment_with_blanks_names_the_columns_of_another_order() {
        let is_table = |comment: &str| {
            let text = format!("# {comment}\n0 1 2 3 0 0 0 1\n");
            Header::find(&text, &ColumnMap::default()).is_some()
        };
        assert!(is_table("timestamp qx qy qz qw tx ty tz"));
        assert!(is_table("tx ty tz qx qy qz qw timestamp"));
        assert!(!is_table("timestamp tx ty tz qx qy qz qw"));
        assert!(!is_table("timestamp tx ty tz qw qx qy qz"));
        assert!(!is_table("time x y z w x y z"));
        assert!(!is_table("tx ty tz qx qy qz qw"));
    }
}
