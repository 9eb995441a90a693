//! Encodings of text files.

/// Decodes a text of UTF-8, or of UTF-16 with a byte order mark, and removes that mark. `None` if
/// it is neither, or contains a null character.
pub(super) fn decode(bytes: &[u8]) -> Option<String> {
    let text = match bytes {
        [0xff, 0xfe, rest @ ..] => from_utf16(rest, u16::from_le_bytes)?,
        [0xfe, 0xff, rest @ ..] => from_utf16(rest, u16::from_be_bytes)?,
        [0xef, 0xbb, 0xbf, rest @ ..] => str::from_utf8(rest).ok()?.to_owned(),
        all => str::from_utf8(all).ok()?.to_owned(),
    };
    (!text.contains('\0')).then_some(text)
}

fn from_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let (units, rest) = bytes.as_chunks::<2>();
    let units = units.iter().map(|pair| unit(*pair));
    let text = char::decode_utf16(units).collect::<Result<String, _>>();
    text.ok().filter(|_| rest.is_empty())
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
        ] {
            assert_eq!(decode(&bytes).as_deref(), Some(text));
        }
    }

    #[test]
    fn what_is_no_text_is_not_decoded() {
        for bytes in [
            // An odd number of bytes, half of a surrogate pair, a null, no mark.
            &[0xff, 0xfe, 0x30][..],
            &[0xfe, 0xff, 0xd8, 0x3d, 0x00, 0x30],
            &[0xff, 0xfe, 0x00, 0x00],
            &[0x30, 0x00, 0x31, 0x00],
            &[0x89, b'P', b'N', b'G'],
        ] {
            assert_eq!(decode(bytes), None, "{bytes:?}");
        }
    }
}
