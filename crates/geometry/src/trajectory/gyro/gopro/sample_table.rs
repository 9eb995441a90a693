//! Place and time of each sample of a track. (A sample of MP4 is a frame, or here a payload of
//! GPMF.)
//!
//! Source: ISO/IEC 14496-12:2022, 8.4.2 (`mdhd`), 8.5.2 (`stsd`), 8.6.1 (`stts`), 8.7 (`stsz`,
//! `stsc`, `stco`, `co64`).

use super::boxes::{Boxes, array_at, find, u32_at};

/// Most payloads: GoPros write one a second.
const MAX_PAYLOADS: u32 = 1 << 20;

/// A payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload {
    /// Position in the file.
    pub position: u64,
    /// Number of bytes.
    pub bytes: u64,
    /// Begin and end on the clock of the video, seconds.
    pub span_s: [f64; 2],
}

/// The payloads of the first track of a format, or [`None`] if there is no such track. `index` is
/// the content of the box `moov`.
///
/// # Errors
/// A damaged index; more payloads than [`MAX_PAYLOADS`], or than `max_bytes` have room for.
pub fn payloads(
    index: &[u8],
    format: [u8; 4],
    max_bytes: u64,
) -> Result<Option<Vec<Payload>>, String> {
    for found in Boxes(index) {
        let (kind, track) = found?;
        if kind != *b"trak" {
            continue;
        }
        let media = find(track, *b"mdia")?;
        let table = find(find(media, *b"minf")?, *b"stbl")?;
        // Version, flags, number of entries, size of the first, format of the first.
        if array_at(find(table, *b"stsd")?, 12)? == format {
            return read(media, table, max_bytes).map(Some);
        }
    }
    Ok(None)
}

fn read(media: &[u8], table: &[u8], max_bytes: u64) -> Result<Vec<Payload>, String> {
    let sizes = sizes(find(table, *b"stsz")?, max_bytes)?;
    let positions = positions(table, &sizes)?;
    let spans_s = spans_s(find(table, *b"stts")?, units_per_s(media)?, sizes.len())?;
    let places = sizes.into_iter().zip(positions).zip(spans_s);
    let payload = |((bytes, position), span_s)| Payload {
        position,
        bytes,
        span_s,
    };
    Ok(places.map(payload).collect())
}

/// Units of the track's times in a second.
fn units_per_s(media: &[u8]) -> Result<f64, String> {
    let header = find(media, *b"mdhd")?;
    // Version 1 has dates of 8 bytes.
    let at = if header.first() == Some(&1) { 20 } else { 12 };
    match u32_at(header, at)? {
        0 => Err("its track has a clock of 0 units a second; the index is damaged".to_owned()),
        units => Ok(f64::from(units)),
    }
}

/// Bytes of each payload.
fn sizes(content: &[u8], max_bytes: u64) -> Result<Vec<u64>, String> {
    let (fixed, count) = (u64::from(u32_at(content, 4)?), u32_at(content, 8)?);
    if count > MAX_PAYLOADS {
        return Err(format!(
            "its index has {count} payloads, more than the {MAX_PAYLOADS} that are read"
        ));
    }
    let mut total = 0;
    let mut sizes = Vec::new();
    for number in 0..count as usize {
        let bytes = match fixed {
            0 => u64::from(u32_at(content, 12 + 4 * number)?),
            fixed => fixed,
        };
        total += bytes;
        if total > max_bytes {
            return Err(format!(
                "its payloads have more than {max_bytes} bytes together; the index is damaged"
            ));
        }
        sizes.push(bytes);
    }
    Ok(sizes)
}

/// Position of each payload in the file: they lie in chunks, one behind the other.
fn positions(table: &[u8], sizes: &[u64]) -> Result<Vec<u64>, String> {
    let chunks = chunks(table)?;
    let groups = find(table, *b"stsc")?;
    let group_count = u32_at(groups, 4)? as usize;
    // First chunk, from 1, and number of payloads in each from there on.
    let group = |number: usize| -> Result<[u32; 2], String> {
        let at = 8 + 12 * number;
        Ok([u32_at(groups, at)?, u32_at(groups, at + 4)?])
    };
    let mut positions = Vec::with_capacity(sizes.len());
    let (mut next_group, mut per_chunk) = (0, 0);
    for (number, start) in chunks.into_iter().enumerate() {
        while next_group < group_count && group(next_group)?[0] as usize <= number + 1 {
            per_chunk = group(next_group)?[1] as usize;
            next_group += 1;
        }
        let mut at = start;
        for bytes in sizes.iter().skip(positions.len()).take(per_chunk) {
            positions.push(at);
            at = at.saturating_add(*bytes);
        }
    }
    if positions.len() != sizes.len() {
        return Err(format!(
            "its index has places of {} payloads and sizes of {}; it is damaged",
            positions.len(),
            sizes.len()
        ));
    }
    Ok(positions)
}

/// Position of each chunk in the file.
fn chunks(table: &[u8]) -> Result<Vec<u64>, String> {
    if let Ok(content) = find(table, *b"stco") {
        let count = u32_at(content, 4)? as usize;
        let position = |k: usize| Ok(u64::from(u32_at(content, 8 + 4 * k)?));
        return (0..count).map(position).collect();
    }
    let content = find(table, *b"co64")?;
    let count = u32_at(content, 4)? as usize;
    let position = |k: usize| Ok(u64::from_be_bytes(array_at(content, 8 + 8 * k)?));
    (0..count).map(position).collect()
}

/// Begin and end of each of `count` payloads, seconds.
fn spans_s(content: &[u8], units_per_s: f64, count: usize) -> Result<Vec<[f64; 2]>, String> {
    let mut spans_s = Vec::with_capacity(count);
    let mut units: u64 = 0;
    let mut runs = (0..u32_at(content, 4)? as usize).map(|run| 8 + 8 * run);
    let (mut left, mut step) = (0, 0);
    while spans_s.len() < count {
        if left == 0 {
            let Some(at) = runs.next() else {
                return Err(format!(
                    "its index has times of {} payloads and sizes of {count}; it is damaged",
                    spans_s.len()
                ));
            };
            (left, step) = (u32_at(content, at)?, u32_at(content, at + 4)?);
            continue;
        }
        let end = units.saturating_add(u64::from(step));
        spans_s.push([units, end].map(|units| units as f64 / units_per_s));
        (units, left) = (end, left - 1);
    }
    Ok(spans_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(numbers: &[u32]) -> Vec<u8> {
        numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
    }

    fn put(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        let size = 8 + content.len() as u32;
        [&size.to_be_bytes()[..], &kind[..], content].concat()
    }

    /// An index with a table of five payloads in three chunks.
    fn index(media_header: &[u8], chunks: &[u8], durations: &[u32]) -> Vec<u8> {
        let description = [numbers(&[0, 1, 16]), b"gpmd".to_vec(), numbers(&[0, 1])].concat();
        let table = [
            put(b"stsd", &description),
            put(b"stts", &numbers(durations)),
            put(b"stsc", &numbers(&[0, 2, 1, 2, 1, 3, 1, 1])),
            put(b"stsz", &numbers(&[0, 0, 5, 10, 20, 30, 40, 50])),
            chunks.to_vec(),
        ];
        let minf = put(b"minf", &put(b"stbl", &table.concat()));
        let media = [put(b"mdhd", media_header), minf].concat();
        put(b"trak", &put(b"mdia", &media))
    }

    #[test]
    fn payloads_lie_in_chunks_and_last_as_the_table_says() {
        let header = numbers(&[0, 1, 2, 1000, 5000, 0]);
        let short = put(b"stco", &numbers(&[0, 3, 100, 200, 300]));
        let durations = [0, 2, 4, 1000, 1, 500];
        let found = payloads(&index(&header, &short, &durations), *b"gpmd", 150).unwrap();
        let found = found.unwrap();
        let positions: Vec<u64> = found.iter().map(|p| p.position).collect();
        assert_eq!(positions, [100, 110, 200, 230, 300]);
        assert_eq!(found[4].span_s, [4.0, 4.5]);
        // Version 1 of the header, and places of 8 bytes.
        let header = numbers(&[1 << 24, 0, 1, 0, 2, 1000, 0, 5000, 0]);
        let long = put(b"co64", &numbers(&[0, 3, 0, 100, 0, 200, 0, 300]));
        let index = index(&header, &long, &durations);
        assert_eq!(payloads(&index, *b"gpmd", 150).unwrap().unwrap(), found);
        assert_eq!(payloads(&index, *b"mp4a", 150).unwrap(), None);
        let message = payloads(&index, *b"gpmd", 149).unwrap_err();
        assert!(message.contains("more than 149 bytes"), "{message}");
    }

    #[test]
    fn tables_that_do_not_agree_are_errors() {
        let header = numbers(&[0, 1, 2, 1000, 5000, 0]);
        let chunks = |count: u32| put(b"stco", &numbers(&[0, count, 100, 200, 300]));
        let all = [0, 1, 5, 1000];
        for (header, chunks, durations, expected) in [
            (
                &header[..],
                chunks(2),
                &all[..],
                "places of 4 payloads and sizes of 5",
            ),
            (&header, chunks(4), &all, "ends after 20 bytes"),
            (
                &header,
                chunks(3),
                &[0, 1, 4, 1000],
                "times of 4 payloads and sizes of 5",
            ),
            (&header, Vec::new(), &all, "no box `co64`"),
            (&[0; 24], chunks(3), &all, "0 units a second"),
        ] {
            let index = index(header, &chunks, durations);
            let message = payloads(&index, *b"gpmd", 150).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
