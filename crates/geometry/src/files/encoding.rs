//! Encodings of text files.

use super::other_content;
use std::char::decode_utf16;

/// The characters of Windows-1252 from 0x80 to 0x9f; those that it does not define are null.
const WINDOWS_1252: [char; 32] = [
    '€', '\0', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\0', 'Ž', '\0', '\0', '‘',
    '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\0', 'ž', 'Ÿ',
];

/// Decodes a text of UTF-8, of UTF-16, or, if it is neither, of Windows-1252, in which spreadsheets
/// of Western Europe save tables. A byte order mark is removed, and line breaks that are carriage
/// returns alone become line feeds.
///
/// UTF-16 without a mark is recognised by the nulls in every other byte of the first characters.
///
/// # Errors
/// A sentence that says what else the file is, if it is no text: it contains null or control
/// characters.
pub fn decode_text(bytes: &[u8]) -> Result<String, &'static str> {
    if let Some(kind) = other_content::kind(bytes) {
        return Err(kind);
    }
    let text = match bytes {
        [0xff, 0xfe, rest @ ..] => from_utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => from_utf16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => str::from_utf8(rest).ok().map(str::to_owned),
        [first, 0, second, 0, ..] if *first != 0 && *second != 0 => {
            from_utf16(bytes, u16::from_le_bytes)
        }
        [0, first, 0, second, ..] if *first != 0 && *second != 0 => {
            from_utf16(bytes, u16::from_be_bytes)
        }
        all => str::from_utf8(all)
            .ok()
            .map(str::to_owned)
            .or_else(|| from_windows_1252(all)),
    };
    let text = text.filter(|text| !text.contains('\0'));
    let text = text.ok_or("is no text of UTF-8, UTF-16 or Windows-1252")?;
    Ok(with_line_feeds(text))
}

fn from_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let (units, rest) = bytes.as_chunks::<2>();
    let units = units.iter().map(|pair| unit(*pair));
    let text = decode_utf16(units).collect::<Result<String, _>>();
    text.ok().filter(|_| rest.is_empty())
}

fn from_windows_1252(bytes: &[u8]) -> Option<String> {
    let decoded = |byte: &u8| match byte {
        b'\t' | b'\n' | b'\r' | 0x20..=0x7e => Some(char::from(*byte)),
        0x80..=0x9f => {
            let character = WINDOWS_1252[usize::from(byte - 0x80)];
            (character != '\0').then_some(character)
        }
        0xa0..=0xff => Some(char::from(*byte)),
        _ => None,
    };
    bytes.iter().map(decoded).collect()
}

/// The text with line feeds where it has carriage returns alone, as classic Mac OS has and
/// spreadsheets offer it.
fn with_line_feeds(text: String) -> String {
    if text.contains('\r') && !text.contains('\n') {
        text.replace('\r', "\n")
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, bytes: fn(u16) -> [u8; 2]) -> Vec<u8> {
        text.encode_utf16().flat_map(bytes).collect()
    }

    #[test]
    fn every_mark_is_removed() {
        let text = "größe;0,5\r\n😀";
        let marked = format!("\u{feff}{text}");
        for bytes in [
            text.as_bytes().to_vec(),
            marked.as_bytes().to_vec(),
            utf16(&marked, u16::to_le_bytes),
            utf16(&marked, u16::to_be_bytes),
            utf16(text, u16::to_le_bytes),
            utf16(text, u16::to_be_bytes),
        ] {
            assert_eq!(decode_text(&bytes).as_deref(), Ok(text));
        }
    }

    /// A German spreadsheet's table: ö, ß and the sign of the euro.
    #[test]
    fn tables_of_western_spreadsheets_are_read() {
        let bytes = b"Gr\xf6\xdfe;0,5 \x80\r\n";
        assert_eq!(decode_text(bytes).as_deref(), Ok("Größe;0,5 €\r\n"));
    }

    #[test]
    fn carriage_returns_alone_end_lines() {
        assert_eq!(decode_text(b"a;b\r1;2\r").as_deref(), Ok("a;b\n1;2\n"));
        assert_eq!(decode_text(b"a\r\nb\r").as_deref(), Ok("a\r\nb\r"));
    }

    #[test]
    fn what_is_no_text_is_not_decoded() {
        for bytes in [
            // An odd number of bytes, half of a surrogate pair, nulls, a control character.
            &[0xff, 0xfe, 0x30][..],
            &[0xfe, 0xff, 0xd8, 0x3d, 0x00, 0x30],
            &[0xff, 0xfe, 0x00, 0x00],
            &[0x30, 0x00, 0x00, 0x00],
            &[0x30, 0x00, 0x31, 0x00, 0x30],
            b"\x89PNG\r\n\x1a\n",
            b"\x81",
        ] {
            let error = decode_text(bytes).unwrap_err();
            assert!(error.starts_with("is no text"), "{bytes:?}: {error}");
        }
        assert!(
            decode_text(b"PK\x03\x04\x14\0")
                .unwrap_err()
                .contains("save the sheet as CSV")
        );
    }
}
