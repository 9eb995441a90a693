//! The time in a picture's EXIF data.
//!
//! EXIF is a TIFF file without pictures: a directory has entries of twelve bytes (tag, type, count,
//! value or its offset), and names the directory of the camera by its offset. Source: EXIF 2.32,
//! JEITA CP-3451.

use tunnelstitch_geometry::trajectory::times;

/// The directory of the camera.
const EXIF_DIRECTORY: u16 = 0x8769;
/// Date and time of the exposure, `2026:11:25 08:47:38`, the decimals of its seconds, and its zone
/// of time, `+01:00`.
const DATE_TIME_ORIGINAL: u16 = 0x9003;
const SUBSEC_TIME_ORIGINAL: u16 = 0x9291;
const OFFSET_TIME_ORIGINAL: u16 = 0x9011;
/// Bytes of an entry, and those before its value or offset.
const ENTRY_BYTES: usize = 12;
const VALUE_OFFSET: usize = 8;
/// Bytes of a value that stands in the entry itself.
const MAX_INLINE_BYTES: usize = 4;

/// The time of the exposure, seconds since 1970, of UTC if no zone is named; None without a date.
pub(super) fn time_s(exif: &[u8]) -> Option<f64> {
    let data = match exif.get(..4)? {
        b"II*\0" => Data { exif, le: true },
        b"MM\0*" => Data { exif, le: false },
        _ => return None,
    };
    let camera = data.entry(data.u32(4)?, EXIF_DIRECTORY)?;
    let camera = data.u32(camera + VALUE_OFFSET)?;
    let text = |tag: u16| data.text(data.entry(camera, tag)?);
    let taken = text(DATE_TIME_ORIGINAL)?;
    let (date, time) = taken.split_once(' ')?;
    let decimals = text(SUBSEC_TIME_ORIGINAL).filter(|digits| !digits.is_empty());
    let decimals = decimals.map_or(String::new(), |digits| format!(".{digits}"));
    let zone = text(OFFSET_TIME_ORIGINAL).unwrap_or_default();
    let word = format!("{}T{time}{decimals}{zone}", date.replace(':', "-"));
    times::from_word(&word, None)
}

/// The bytes of a TIFF file, and their order.
#[derive(Clone, Copy)]
struct Data<'a> {
    exif: &'a [u8],
    /// True if the lowest byte comes first.
    le: bool,
}

impl Data<'_> {
    fn u16(self, at: usize) -> Option<u16> {
        let bytes = self.exif.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.le {
            u16::from_le_bytes(bytes)
        } else {
            u16::from_be_bytes(bytes)
        })
    }

    fn u32(self, at: usize) -> Option<usize> {
        let bytes = self.exif.get(at..at.checked_add(4)?)?.try_into().ok()?;
        let value = if self.le {
            u32::from_le_bytes(bytes)
        } else {
            u32::from_be_bytes(bytes)
        };
        usize::try_from(value).ok()
    }

    /// The place of the entry of that tag in the directory at `directory`.
    fn entry(self, directory: usize, tag: u16) -> Option<usize> {
        let count = usize::from(self.u16(directory)?);
        let place = |k: usize| directory.checked_add(2 + ENTRY_BYTES * k);
        let mut places = (0..count).map_while(place);
        places.find(|at| self.u16(*at) == Some(tag))
    }

    /// The text of an entry.
    fn text(self, entry: usize) -> Option<String> {
        let length = self.u32(entry + 4)?;
        let value = entry + VALUE_OFFSET;
        let at = match length {
            ..=MAX_INLINE_BYTES => value,
            _ => self.u32(value)?,
        };
        let bytes = self.exif.get(at..at.checked_add(length)?)?;
        let text = std::str::from_utf8(bytes).ok()?;
        Some(text.trim_matches(['\0', ' ']).to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// EXIF data with texts under tags of the camera's directory.
    fn exif(le: bool, texts: &[(u16, &str)]) -> Vec<u8> {
        let short = |v: u16| if le { v.to_le_bytes() } else { v.to_be_bytes() };
        let long = |v: usize| {
            let v = u32::try_from(v).unwrap();
            if le { v.to_le_bytes() } else { v.to_be_bytes() }
        };
        let entry = |tag: u16, kind: u16, count: usize, value: [u8; 4]| {
            [&short(tag)[..], &short(kind), &long(count), &value].concat()
        };
        let mut bytes = if le {
            b"II*\0".to_vec()
        } else {
            b"MM\0*".to_vec()
        };
        bytes.extend(long(8));
        bytes.extend(short(1));
        bytes.extend(entry(EXIF_DIRECTORY, 4, 1, long(26)));
        bytes.extend(long(0));
        bytes.extend(short(u16::try_from(texts.len()).unwrap()));
        let mut values = Vec::new();
        let begin = 28 + ENTRY_BYTES * texts.len();
        for (tag, text) in texts {
            let text = [text.as_bytes(), b"\0"].concat();
            let value = match text.len() {
                ..=MAX_INLINE_BYTES => {
                    let mut inline = [0; 4];
                    inline[..text.len()].copy_from_slice(&text);
                    inline
                }
                _ => long(begin + values.len()),
            };
            bytes.extend(entry(*tag, 2, text.len(), value));
            values.extend(if text.len() > MAX_INLINE_BYTES {
                text
            } else {
                Vec::new()
            });
        }
        bytes.extend(values);
        bytes
    }

    #[test]
    fn date_decimals_and_zone_are_read() {
        let date = (DATE_TIME_ORIGINAL, "2026:11:25 08:47:38");
        for le in [false, true] {
            let read = |texts: &[(u16, &str)]| time_s(&exif(le, texts));
            assert_eq!(read(&[date]), Some(1_795_596_458.0));
            assert_eq!(
                read(&[date, (SUBSEC_TIME_ORIGINAL, "25")]),
                Some(1_795_596_458.25)
            );
            let zoned = [
                date,
                (OFFSET_TIME_ORIGINAL, "+01:00"),
                (SUBSEC_TIME_ORIGINAL, "5000"),
            ];
            assert_eq!(read(&zoned), Some(1_795_592_858.5));
            assert_eq!(read(&[(SUBSEC_TIME_ORIGINAL, "25")]), None);
            assert_eq!(read(&[(DATE_TIME_ORIGINAL, "    :  :     :  :  ")]), None);
        }
    }

    /// Damaged data have no time, or the one they have.
    #[test]
    fn data_that_are_cut_off_have_no_time() {
        let whole = exif(true, &[(DATE_TIME_ORIGINAL, "2026:11:25 08:47:38")]);
        for length in 0..whole.len() {
            assert_eq!(time_s(&whole[..length]), None, "{length}");
        }
    }
}
