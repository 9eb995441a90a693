//! Tables of text: their separator and their records.

use csv::{ReaderBuilder, StringRecord};

/// The records with content and the 1-based numbers of their first lines, without blank lines and
/// comments; a record goes on in the next line while a quoted field is open.
pub(super) fn records(text: &str, separator: u8) -> impl Iterator<Item = (usize, &str)> {
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
            // Spreadsheets write rows of separators alone, Markdown a rule below the titles.
            let is_rule = |byte| separator == b'|' && b"-:".contains(&byte);
            let is_blank = |byte| byte == separator || byte == b' ' || is_rule(byte);
            let is_empty = record.bytes().all(is_blank);
            if !(is_empty || is_comment) {
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
pub(crate) fn separator(header: &str) -> u8 {
    let is_there = |separator: &u8| header.as_bytes().contains(separator);
    [b'\t', b';', b',', b'|']
        .into_iter()
        .find(is_there)
        .unwrap_or(b',')
}

/// The separator of a table's columns, from its first line, in which blanks may separate, too.
pub(super) fn separator_or_blank(header: &str) -> u8 {
    let is_blank = !header.contains(['\t', ';', ',', '|']) && header.contains(' ');
    if is_blank { b' ' } else { separator(header) }
}

/// Splits a line into columns. Several blanks separate as one does.
pub(crate) fn split(line: &str, separator: u8) -> Result<StringRecord, String> {
    if separator == b' ' {
        return Ok(line.split_whitespace().collect());
    }
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
