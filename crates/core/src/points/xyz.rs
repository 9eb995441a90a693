//! Text with a point in each line.
//!
//! A line has three numbers or more, separated by spaces, tabs, commas or semicolons; what follows
//! the third is ignored (intensity, colour). Empty lines and what follows a `#` or `//` are
//! comments. The first line that is none may be a header (`x,y,z`), or a number alone (the number
//! of points, as in `.pts`).

use super::error::PointsError;
use super::point_visitor::{Place, PointVisitor};
use std::io::{BufRead, Read};

/// Longest line, bytes: a file without line breaks is no text with points.
pub const MAX_LINE_BYTES: u64 = 1 << 16;

/// Reads all points.
///
/// # Errors
/// A line that is too long or has no three finite numbers.
pub fn read(reader: &mut impl BufRead, visitor: &mut PointVisitor) -> Result<(), PointsError> {
    let mut line = Vec::new();
    let (mut number, mut is_first) = (0, true);
    while read_line(reader, &mut line, number + 1, visitor)? {
        number += 1;
        let text = String::from_utf8_lossy(&line);
        let text = text.split('#').next().unwrap_or_default();
        let text = text.split("//").next().unwrap_or_default().trim();
        if text.is_empty() {
            continue;
        }
        let is_separator = |c: char| c.is_whitespace() || c == ',' || c == ';';
        let fields = text.split(is_separator).filter(|field| !field.is_empty());
        let numbers: Vec<Option<f64>> = fields.take(3).map(|field| field.parse().ok()).collect();
        let is_header = is_first && (numbers.len() == 1 || numbers.iter().all(Option::is_none));
        is_first = false;
        match numbers[..] {
            [Some(x), Some(y), Some(z)] => visitor.put(Place::Line(number), [x, y, z])?,
            _ if is_header => {}
            _ => {
                return Err(visitor.error(
                    Place::Line(number),
                    "is no point; a line is x y z in metres, separated by spaces or commas, and \
                     only the first may be a header",
                ));
            }
        }
    }
    Ok(())
}

/// Reads the line `number`; false at the end of the file.
///
/// # Errors
/// A line that is too long or cannot be read.
pub fn read_line(
    reader: &mut impl BufRead,
    line: &mut Vec<u8>,
    number: u64,
    visitor: &PointVisitor,
) -> Result<bool, PointsError> {
    line.clear();
    let mut limited = reader.by_ref().take(MAX_LINE_BYTES);
    let bytes = limited.read_until(b'\n', line);
    let bytes = bytes
        .map_err(|error| visitor.error(Place::Line(number), format!("cannot be read: {error}")))?;
    if bytes as u64 == MAX_LINE_BYTES && line.last() != Some(&b'\n') {
        let what = format!(
            "is longer than {MAX_LINE_BYTES} bytes; the file is no text with a point in each line"
        );
        return Err(visitor.error(Place::Line(number), what));
    }
    Ok(bytes > 0)
}
