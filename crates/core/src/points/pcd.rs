//! PCD: fields `x`, `y` and `z`, as text, binary or compressed.
//!
//! A header of lines `VERSION`, `FIELDS`, `SIZE`, `TYPE`, `COUNT`, `WIDTH`, `HEIGHT`, `VIEWPOINT`,
//! `POINTS` and `DATA` precedes the data. Binary points are records of all fields, little-endian.
//! Compressed ones are a block of LZF with its two sizes before it, which has one field of all
//! points after another. The viewpoint is ignored: it says where the sensor was, not where the
//! points are.

use super::error::PointsError;
use super::lzf;
use super::point_visitor::{Place, PointVisitor};
use super::xyz::read_line;
use std::io::BufRead;

/// Lines of a header at the most.
const MAX_HEADER_LINES: u64 = 1000;
/// Bytes of a binary record at the most.
const MAX_RECORD_BYTES: u64 = 1 << 16;
/// Bytes of a compressed block at the most, which is held in memory.
const MAX_BLOCK_BYTES: u64 = 1 << 30;

/// A coordinate in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Coordinate {
    /// First byte in the record.
    offset: usize,
    /// Column of a line of text.
    column: usize,
    /// Bytes: 4 or 8, of a floating-point number.
    size: usize,
}

/// The header of a file.
struct Header {
    /// x, y and z.
    coordinates: [Coordinate; 3],
    /// Bytes of a record.
    record_bytes: usize,
    /// Number of points.
    points: u64,
    /// Encoding of the data.
    data: String,
    /// Lines of the header.
    lines: u64,
}

/// Reads all points; `bytes`: size of the file.
///
/// # Errors
/// A header that is none, or without positions; points that are missing or damaged; coordinates
/// that are not finite.
pub fn read(
    reader: &mut impl BufRead,
    bytes: u64,
    visitor: &mut PointVisitor,
) -> Result<(), PointsError> {
    let header = read_header(reader, visitor)?;
    match header.data.as_str() {
        "ascii" => read_text(reader, &header, visitor),
        "binary" => read_binary(reader, &header, visitor),
        "binary_compressed" => read_compressed(reader, &header, bytes, visitor),
        other => {
            let what = format!(
                "DATA is {other}; it must be ascii, binary or binary_compressed: save the file as \
                 one of them"
            );
            Err(PointsError::line(visitor.path(), header.lines, what))
        }
    }
}

/// Reads the header, up to the line `DATA`.
fn read_header(reader: &mut impl BufRead, visitor: &PointVisitor) -> Result<Header, PointsError> {
    let path = visitor.path();
    let (mut fields, mut sizes, mut types) = (Vec::new(), Vec::new(), Vec::new());
    let (mut counts, mut points, mut line) = (Vec::new(), None, Vec::new());
    let (mut width, mut height) = (None, None);
    for number in 1..=MAX_HEADER_LINES {
        if !read_line(reader, &mut line, number, visitor)? {
            break;
        }
        let text = String::from_utf8_lossy(&line).into_owned();
        let mut words = text.split_whitespace().map(str::to_owned);
        let Some(key) = words.next() else { continue };
        let fail = |what: &str| PointsError::line(path, number, what);
        let whole = |words: &mut dyn Iterator<Item = String>| {
            let values: Result<Vec<u64>, _> = words.map(|word| word.parse()).collect();
            values.map_err(|_| fail("is not made of whole numbers, as a header of PCD needs it"))
        };
        match key.as_str() {
            "FIELDS" => fields = words.collect(),
            "SIZE" => sizes = whole(&mut words)?,
            "TYPE" => types = words.collect::<Vec<String>>(),
            "COUNT" => counts = whole(&mut words)?,
            "WIDTH" => width = whole(&mut words)?.first().copied(),
            "HEIGHT" => height = whole(&mut words)?.first().copied(),
            "POINTS" => points = whole(&mut words)?.first().copied(),
            "DATA" => {
                let area = width
                    .zip(height)
                    .map(|(w, h): (u64, u64)| w.saturating_mul(h));
                let Some(points) = points.or(area) else {
                    return Err(fail("the header has neither POINTS nor WIDTH and HEIGHT"));
                };
                let (coordinates, record_bytes) =
                    layout(&fields, &sizes, &types, &counts).map_err(|what| fail(&what))?;
                return Ok(Header {
                    coordinates,
                    record_bytes,
                    points,
                    data: words.next().unwrap_or_default(),
                    lines: number,
                });
            }
            _ => {}
        }
    }
    Err(PointsError::file(
        path,
        "has no header of a PCD file with a line DATA",
    ))
}

/// Places of x, y and z, and the bytes of a record; or what is wrong.
fn layout(
    fields: &[String],
    sizes: &[u64],
    types: &[String],
    counts: &[u64],
) -> Result<([Coordinate; 3], usize), String> {
    let ones = vec![1; fields.len()];
    let counts = if counts.is_empty() { &ones } else { counts };
    if [sizes.len(), types.len(), counts.len()] != [fields.len(); 3] {
        return Err("FIELDS, SIZE, TYPE and COUNT have different numbers of fields".to_owned());
    }
    let mut coordinates = [None; 3];
    let (mut offset, mut column) = (0u64, 0u64);
    for (k, name) in fields.iter().enumerate() {
        let axis = ["x", "y", "z"].iter().position(|axis| axis == name);
        if let Some(axis) = axis {
            if types[k] != "F" || !matches!(sizes[k], 4 | 8) || counts[k] != 1 {
                return Err(format!(
                    "field {name} is no floating-point number of 4 or 8 bytes"
                ));
            }
            coordinates[axis] = Some(Coordinate {
                offset: offset as usize,
                column: column as usize,
                size: sizes[k] as usize,
            });
        }
        offset = offset.saturating_add(sizes[k].saturating_mul(counts[k]));
        column = column.saturating_add(counts[k]);
        if offset > MAX_RECORD_BYTES || column > MAX_RECORD_BYTES {
            return Err(format!("a point has more than {MAX_RECORD_BYTES} bytes"));
        }
    }
    match coordinates {
        [Some(x), Some(y), Some(z)] => Ok(([x, y, z], offset as usize)),
        _ => Err("the header has no fields x, y and z, thus no points".to_owned()),
    }
}

/// Reads points as text.
fn read_text(
    reader: &mut impl BufRead,
    header: &Header,
    visitor: &mut PointVisitor,
) -> Result<(), PointsError> {
    let mut line = Vec::new();
    let mut number = header.lines;
    let mut done = 0;
    while done < header.points {
        number += 1;
        if !read_line(reader, &mut line, number, visitor)? {
            let what = format!(
                "the file ends after {done} of {} points; copy it again",
                header.points
            );
            return Err(PointsError::line(visitor.path(), number, what));
        }
        let text = String::from_utf8_lossy(&line);
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.is_empty() {
            continue;
        }
        let value = |c: Coordinate| words.get(c.column).and_then(|word| word.parse().ok());
        let [Some(x), Some(y), Some(z)] = header.coordinates.map(value) else {
            let what = "is no point with the fields of the header";
            return Err(PointsError::line(visitor.path(), number, what));
        };
        visitor.put_measured(Place::Line(number), [x, y, z])?;
        done += 1;
    }
    Ok(())
}

/// Reads points as records.
fn read_binary(
    reader: &mut impl BufRead,
    header: &Header,
    visitor: &mut PointVisitor,
) -> Result<(), PointsError> {
    let mut record = vec![0; header.record_bytes];
    for k in 1..=header.points {
        if reader.read_exact(&mut record).is_err() {
            let what = format!(
                "is missing, of {} points; copy the file again",
                header.points
            );
            return Err(PointsError::point(visitor.path(), k, what));
        }
        let value = |c: Coordinate| number_at(&record, c.offset, c.size).unwrap_or(f64::INFINITY);
        visitor.put_measured(Place::Point(k), header.coordinates.map(value))?;
    }
    Ok(())
}

/// Reads points as a compressed block, field after field.
fn read_compressed(
    reader: &mut impl BufRead,
    header: &Header,
    bytes: u64,
    visitor: &mut PointVisitor,
) -> Result<(), PointsError> {
    let path = visitor.path();
    let mut sizes = [0; 8];
    let is_cut_off = "the compressed block is cut off; copy the file again";
    let cut_off = |_| PointsError::file(path, is_cut_off);
    reader.read_exact(&mut sizes).map_err(cut_off)?;
    let [a, b, c, d, e, f, g, h] = sizes;
    let (packed, size) = (
        u32::from_le_bytes([a, b, c, d]),
        u32::from_le_bytes([e, f, g, h]),
    );
    let needed = header.points.saturating_mul(header.record_bytes as u64);
    if u64::from(size) != needed || needed > MAX_BLOCK_BYTES {
        let what = format!(
            "its compressed block holds {size} bytes for {} points of {} bytes; they must agree, \
             and be no more than {MAX_BLOCK_BYTES}: save the file as DATA binary",
            header.points, header.record_bytes
        );
        return Err(PointsError::file(path, what));
    }
    if u64::from(packed) > bytes {
        return Err(PointsError::file(path, is_cut_off));
    }
    let mut compressed = vec![0; packed as usize];
    reader.read_exact(&mut compressed).map_err(cut_off)?;
    let Some(block) = lzf::decompress(&compressed, size as usize) else {
        let what = "the compressed block is damaged; copy the file again";
        return Err(PointsError::file(path, what));
    };
    let count = header.points as usize;
    for k in 0..count {
        let value = |c: Coordinate| {
            let at = c.offset * count + k * c.size;
            number_at(&block, at, c.size).unwrap_or(f64::INFINITY)
        };
        visitor.put_measured(Place::Point(k as u64 + 1), header.coordinates.map(value))?;
    }
    Ok(())
}

/// The floating-point number of `size` bytes at `offset`; None beyond the end.
fn number_at(bytes: &[u8], offset: usize, size: usize) -> Option<f64> {
    let bytes = bytes.get(offset..offset + size)?;
    if size == 4 {
        Some(f64::from(f32::from_le_bytes(bytes.try_into().ok()?)))
    } else {
        Some(f64::from_le_bytes(bytes.try_into().ok()?))
    }
}
