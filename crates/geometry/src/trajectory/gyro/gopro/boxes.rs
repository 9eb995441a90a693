//! Boxes of MP4 and QuickTime files: size, kind, content.
//!
//! Source: ISO/IEC 14496-12:2022, 4.2.

/// Bytes of the longest header of a box.
pub const MAX_HEADER_BYTES: u64 = 16;

/// The header of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoxHeader {
    /// Four letters.
    pub kind: [u8; 4],
    /// Bytes of the header itself.
    pub header_bytes: u64,
    /// Bytes of header and content.
    pub bytes: u64,
}

impl BoxHeader {
    /// Reads a header from the first bytes of a box; `room` is the number of bytes up to the end
    /// of what the box lies in.
    ///
    /// # Errors
    /// A box that is shorter than its header or longer than there is room.
    pub fn parse(start: &[u8], room: u64) -> Result<Self, String> {
        let size = u32_at(start, 0)?;
        let kind = array_at(start, 4)?;
        let (header_bytes, bytes) = match size {
            // To the end of the file.
            0 => (8, room),
            1 => (16, u64::from_be_bytes(array_at(start, 8)?)),
            size => (8, u64::from(size)),
        };
        if bytes < header_bytes || bytes > room {
            return Err(format!(
                "the box `{}` says that it has {bytes} bytes, and there is room for {room}; the \
                 file is damaged or cut off",
                kind.escape_ascii()
            ));
        }
        Ok(Self {
            kind,
            header_bytes,
            bytes,
        })
    }
}

/// The content of the first box of a kind in the content of another.
///
/// # Errors
/// No such box; one before it that is damaged.
pub fn find(content: &[u8], kind: [u8; 4]) -> Result<&[u8], String> {
    let missing = || {
        let kind = kind.escape_ascii();
        format!("its index has no box `{kind}`; it is damaged")
    };
    find_if_there(content, kind)?.ok_or_else(missing)
}

/// The content of the first box of a kind in the content of another, if there is one.
///
/// # Errors
/// A box before it that is damaged.
pub fn find_if_there(content: &[u8], kind: [u8; 4]) -> Result<Option<&[u8]>, String> {
    for found in Boxes(content) {
        let (found_kind, content) = found?;
        if found_kind == kind {
            return Ok(Some(content));
        }
    }
    Ok(None)
}

/// Iterator over the boxes in the content of another: kind and content. It ends after an error.
pub struct Boxes<'a>(pub &'a [u8]);

impl<'a> Iterator for Boxes<'a> {
    type Item = Result<([u8; 4], &'a [u8]), String>;

    fn next(&mut self) -> Option<Self::Item> {
        // QuickTime ends some lists with four zeros.
        if self.0.len() < 8 {
            return None;
        }
        let rest = std::mem::take(&mut self.0);
        let read = || {
            let header = BoxHeader::parse(rest, rest.len() as u64)?;
            let (all, others) = rest.split_at(header.bytes as usize);
            Ok((header.kind, &all[header.header_bytes as usize..], others))
        };
        Some(read().map(|(kind, content, others)| {
            self.0 = others;
            (kind, content)
        }))
    }
}

/// The number of 4 bytes at a position of a box.
///
/// # Errors
/// A box that ends before.
pub fn u32_at(content: &[u8], at: usize) -> Result<u32, String> {
    Ok(u32::from_be_bytes(array_at(content, at)?))
}

/// The bytes at a position of a box.
///
/// # Errors
/// A box that ends before.
pub fn array_at<const N: usize>(content: &[u8], at: usize) -> Result<[u8; N], String> {
    let bytes = content.get(at..).and_then(|rest| rest.first_chunk());
    let cut_off = || format!("a box of its index ends after {} bytes", content.len());
    bytes.copied().ok_or_else(cut_off)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_may_be_long_or_reach_to_the_end() {
        let mut list = vec![0, 0, 0, 10, b'a', b'b', b'c', b'd', 1, 2];
        list.extend([
            0, 0, 0, 1, b'l', b'o', b'n', b'g', 0, 0, 0, 0, 0, 0, 0, 17, 3,
        ]);
        list.extend([0, 0, 0, 0, b'l', b'a', b's', b't', 4, 5]);
        let boxes: Result<Vec<_>, String> = Boxes(&list).collect();
        let expected: [([u8; 4], &[u8]); 3] =
            [(*b"abcd", &[1, 2]), (*b"long", &[3]), (*b"last", &[4, 5])];
        assert_eq!(boxes.unwrap(), expected);
        assert_eq!(find(&list, *b"long").unwrap(), [3]);
        assert!(find(&list, *b"none").unwrap_err().contains("no box `none`"));
    }

    #[test]
    fn impossible_sizes_are_errors() {
        for size in [2, 7, 13, u32::MAX] {
            let mut list = size.to_be_bytes().to_vec();
            list.extend(b"abcd1234");
            let boxes: Vec<_> = Boxes(&list).collect();
            assert!(matches!(boxes.as_slice(), [Err(_)]), "{boxes:?}");
        }
        let long = [0, 0, 0, 1, b'l', b'o', b'n', b'g', 255, 0, 0, 0, 0, 0, 0, 0];
        assert!(Boxes(&long).next().unwrap().is_err());
        assert!(Boxes(&long[..12]).next().unwrap().is_err());
        assert!(Boxes(&[0; 7]).next().is_none());
    }
}
