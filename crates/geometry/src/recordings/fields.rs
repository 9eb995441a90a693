//! Numbers, texts and lists in the records and messages of recordings.
//!
//! | layout | numbers | text |
//! | --- | --- | --- |
//! | packed: records of MCAP and of bags, messages of ROS 1 | little-endian, one after the other | length of 4 bytes, bytes |
//! | CDR: messages of ROS 2 | in either order, each at a multiple of its size | length with the final zero, bytes, zero |
//!
//! Source: the ROS wiki, "msg" (serialisation); OMG, "DDS Interoperability Wire Protocol" 2.2,
//! section 10 (encapsulation), and CORBA 3.4, part 2, section 9.3 (CDR).

/// Bytes of the encapsulation header of a CDR message.
const CDR_HEADER_BYTES: usize = 4;

/// Order and alignment of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    Packed,
    Cdr { is_big_endian: bool },
}

/// The fields of a record or message, read in order.
#[derive(Clone, Debug)]
pub struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
    layout: Layout,
}

impl<'a> Fields<'a> {
    /// Fields without gaps, little-endian.
    pub fn packed(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            layout: Layout::Packed,
        }
    }

    /// The fields of a CDR message with its encapsulation header.
    ///
    /// # Errors
    /// A message without that header, or of another encapsulation than plain CDR.
    pub fn cdr(bytes: &'a [u8]) -> Result<Self, String> {
        let Some((header, bytes)) = bytes.split_at_checked(CDR_HEADER_BYTES) else {
            return Err(format!("a message of {} bytes is no CDR", bytes.len()));
        };
        let is_big_endian = match header {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            _ => {
                return Err(format!(
                    "the encapsulation {:02x} {:02x} is not read; plain CDR (00 00, 00 01) is",
                    header[0], header[1]
                ));
            }
        };
        Ok(Self {
            bytes,
            at: 0,
            layout: Layout::Cdr { is_big_endian },
        })
    }

    /// Position of the next byte.
    pub fn at(&self) -> usize {
        self.at
    }

    /// The bytes that are left.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// The next bytes.
    ///
    /// # Errors
    /// Fewer bytes.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let taken = self.rest().get(..count).ok_or_else(|| {
            format!(
                "{count} bytes are missing after {} of {}",
                self.at,
                self.bytes.len()
            )
        })?;
        self.at += count;
        Ok(taken)
    }

    /// The bytes of a number, in little-endian order.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], String> {
        if matches!(self.layout, Layout::Cdr { .. }) {
            let gap = self.at.next_multiple_of(N) - self.at;
            self.take(gap)?;
        }
        let mut number = [0; N];
        number.copy_from_slice(self.take(N)?);
        if self.layout
            == (Layout::Cdr {
                is_big_endian: true,
            })
        {
            number.reverse();
        }
        Ok(number)
    }

    /// An unsigned number of one byte.
    ///
    /// # Errors
    /// Fields that end before, as for all that follow.
    pub fn u8(&mut self) -> Result<u8, String> {
        Ok(u8::from_le_bytes(self.number()?))
    }

    /// An unsigned number of 2 bytes.
    ///
    /// # Errors
    /// Fields that end before.
    pub fn u16(&mut self) -> Result<u16, String> {
        Ok(u16::from_le_bytes(self.number()?))
    }

    /// An unsigned number of 4 bytes.
    ///
    /// # Errors
    /// Fields that end before.
    pub fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.number()?))
    }

    /// An unsigned number of 8 bytes.
    ///
    /// # Errors
    /// Fields that end before.
    pub fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.number()?))
    }

    /// N floating-point numbers of 8 bytes; they need not be finite.
    ///
    /// # Errors
    /// Fields that end before.
    pub fn f64s<const N: usize>(&mut self) -> Result<[f64; N], String> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_le_bytes(self.number()?);
        }
        Ok(values)
    }

    /// A list of at most `most` floating-point numbers of 8 bytes.
    ///
    /// # Errors
    /// A longer list; fields that end before.
    pub fn f64_list(&mut self, most: usize) -> Result<Vec<f64>, String> {
        let count = self.u32()? as usize;
        if count > most {
            return Err(format!(
                "a list of {count} numbers, of which at most {most} are read"
            ));
        }
        (0..count).map(|_| Ok(self.f64s::<1>()?[0])).collect()
    }

    /// A list of bytes.
    ///
    /// # Errors
    /// Fields that end before.
    pub fn byte_list(&mut self) -> Result<&'a [u8], String> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    /// A text.
    ///
    /// # Errors
    /// A text that is not UTF-8; fields that end before.
    pub fn text(&mut self) -> Result<&'a str, String> {
        let bytes = self.byte_list()?;
        let bytes = match self.layout {
            Layout::Packed => bytes,
            Layout::Cdr { .. } => bytes.strip_suffix(&[0]).unwrap_or(bytes),
        };
        std::str::from_utf8(bytes).map_err(|_| "a text that is not UTF-8".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_cdr_lie_at_multiples_of_their_size() {
        let mut message = vec![0, 1, 0, 0, 7, 0, 0, 0];
        message.extend(3u32.to_le_bytes());
        message.extend(b"ab\0");
        message.extend([0; 5]);
        message.extend(1.5f64.to_le_bytes());
        let mut fields = Fields::cdr(&message).unwrap();
        assert_eq!((fields.u8(), fields.u8()), (Ok(7), Ok(0)));
        assert_eq!((fields.text(), fields.f64s()), (Ok("ab"), Ok([1.5])));
        assert!(fields.rest().is_empty() && fields.u8().is_err());
        let big = [0, 0, 0, 0, 0, 0, 1, 2];
        assert_eq!(Fields::cdr(&big).unwrap().u32(), Ok(0x102));
        assert!(Fields::cdr(&[0, 3, 0, 0]).unwrap_err().contains("00 03"));
        assert!(Fields::cdr(&[0, 1]).is_err());
    }

    #[test]
    fn lists_are_no_longer_than_the_message() {
        let mut message = u32::MAX.to_le_bytes().to_vec();
        message.extend([0; 8]);
        let fields = Fields::packed(&message);
        assert!(fields.clone().byte_list().unwrap_err().contains("missing"));
        assert!(
            fields
                .clone()
                .f64_list(16)
                .unwrap_err()
                .contains("at most 16")
        );
        assert!(fields.clone().text().is_err());
    }
}
