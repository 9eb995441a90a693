//! Keys, lengths and values of GPMF; numbers are big-endian.

/// A value with its key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Klv<'a> {
    /// Four letters.
    pub key: [u8; 4],
    /// Type of the numbers, a letter, or 0 of a list of values with keys.
    pub kind: u8,
    /// Bytes of an element.
    pub element_bytes: usize,
    /// All elements.
    pub data: &'a [u8],
}

impl<'a> Klv<'a> {
    /// The values in a list, or none in a value of another type.
    pub fn children(&self) -> KlvList<'a> {
        KlvList(if self.kind == 0 { self.data } else { &[] })
    }

    /// The text, without zeros and spaces at its end.
    pub fn text(&self) -> String {
        let text = String::from_utf8_lossy(self.data);
        text.trim_end_matches(['\0', ' ']).to_owned()
    }

    /// The numbers of each element.
    ///
    /// # Errors
    /// Values that are no numbers, or elements of which the numbers do not fill the bytes.
    pub fn rows(&self) -> Result<Vec<Vec<f64>>, String> {
        let (decode, bytes) = self.decoder()?;
        if self.element_bytes == 0 || !self.element_bytes.is_multiple_of(bytes) {
            return Err(self.damaged());
        }
        let rows = self.data.chunks_exact(self.element_bytes);
        Ok(rows
            .map(|row| row.chunks_exact(bytes).map(decode).collect())
            .collect())
    }

    /// The function that decodes a number of this type, and its bytes.
    fn decoder(&self) -> Result<(Decode, usize), String> {
        Ok(match self.kind {
            b'b' => (signed, 1),
            b'B' => (unsigned, 1),
            b's' => (signed, 2),
            b'S' => (unsigned, 2),
            b'l' => (signed, 4),
            b'L' => (unsigned, 4),
            b'f' => (single, 4),
            b'q' => (fixed, 4),
            b'd' => (double, 8),
            b'j' => (signed, 8),
            b'J' => (unsigned, 8),
            _ => return Err(self.damaged()),
        })
    }

    fn damaged(&self) -> String {
        format!(
            "its `{}` has elements of {} bytes and type `{}`, which are no numbers",
            self.key.escape_ascii(),
            self.element_bytes,
            self.kind.escape_ascii()
        )
    }
}

/// Decodes the bytes of a number.
type Decode = fn(&[u8]) -> f64;

fn signed(bytes: &[u8]) -> f64 {
    let sign = bytes.first().map_or(0, |byte| *byte as i8 >> 7);
    let fold = |all: i64, byte: &u8| all << 8 | i64::from(*byte);
    bytes.iter().fold(i64::from(sign), fold) as f64
}

fn unsigned(bytes: &[u8]) -> f64 {
    let fold = |all: u64, byte: &u8| all << 8 | u64::from(*byte);
    bytes.iter().fold(0, fold) as f64
}

fn single(bytes: &[u8]) -> f64 {
    f64::from(f32::from_bits(unsigned(bytes) as u32))
}

fn double(bytes: &[u8]) -> f64 {
    let bytes = bytes.first_chunk().copied();
    f64::from_be_bytes(bytes.unwrap_or_default())
}

/// 16 bits before the point, and 16 behind it.
fn fixed(bytes: &[u8]) -> f64 {
    signed(bytes) / 65_536.0
}

/// Iterator over values that stand one behind the other. It ends after an error.
pub struct KlvList<'a>(pub &'a [u8]);

impl<'a> KlvList<'a> {
    /// The first value of a key.
    ///
    /// # Errors
    /// A value before it that is damaged.
    pub fn find(self, key: [u8; 4]) -> Result<Option<Klv<'a>>, String> {
        for found in self {
            let klv = found?;
            if klv.key == key {
                return Ok(Some(klv));
            }
        }
        Ok(None)
    }
}

impl<'a> Iterator for KlvList<'a> {
    type Item = Result<Klv<'a>, String>;

    fn next(&mut self) -> Option<Self::Item> {
        let rest = std::mem::take(&mut self.0);
        // Payloads may be filled up with zeros.
        let (header, content) = rest.split_first_chunk::<8>().filter(|(h, _)| h[0] != 0)?;
        let [k, e, y, s, kind, element_bytes, high, low] = *header;
        let key = [k, e, y, s];
        let element_bytes = usize::from(element_bytes);
        let bytes = element_bytes * usize::from(u16::from_be_bytes([high, low]));
        let Some(data) = content.get(..bytes) else {
            return Some(Err(format!(
                "its `{}` has {bytes} bytes, of which {} are there",
                key.escape_ascii(),
                content.len()
            )));
        };
        self.0 = content.get(bytes.next_multiple_of(4)..).unwrap_or_default();
        Some(Ok(Klv {
            key,
            kind,
            element_bytes,
            data,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the format's documentation: one byte, and fifteen.
    #[test]
    fn values_are_padded_to_four_bytes() {
        let mut list = b"DMO1b\x01\x00\x01\xff\0\0\0DMO2b\x01\x00\x0f".to_vec();
        list.extend(0..16);
        list.extend(b"DMO3L\x04\x00\x01\x80\0\0\x01");
        let values: Result<Vec<Klv>, String> = KlvList(&list).collect();
        let values = values.unwrap();
        assert_eq!(values.len(), 3);
        assert_eq!(values[0].rows().unwrap(), [[-1.0]]);
        assert_eq!(values[1].rows().unwrap().len(), 15);
        assert_eq!(values[2].rows().unwrap(), [[2_147_483_649.0]]);
        assert!(KlvList(&list).find(*b"DMO3").unwrap().is_some());
        assert!(KlvList(&[0; 12]).next().is_none());
    }

    #[test]
    fn every_type_of_number_is_decoded() {
        let value = |kind: u8, element_bytes: usize, data: &[u8]| {
            let klv = Klv {
                key: *b"TEST",
                kind,
                element_bytes,
                data,
            };
            klv.rows()
        };
        assert_eq!(value(b's', 4, &[0xff, 0xfe, 0, 2]).unwrap(), [[-2.0, 2.0]]);
        assert_eq!(value(b'S', 2, &[0xff, 0xfe]).unwrap(), [[65_534.0]]);
        assert_eq!(value(b'l', 4, &[0xff; 4]).unwrap(), [[-1.0]]);
        assert_eq!(value(b'j', 8, &[0xff; 8]).unwrap(), [[-1.0]]);
        assert_eq!(value(b'J', 8, &[0; 8]).unwrap(), [[0.0]]);
        assert_eq!(value(b'q', 4, &[0xff, 0xff, 0x80, 0]).unwrap(), [[-0.5]]);
        let [single, double] = [1.5f32.to_be_bytes().to_vec(), 1.5f64.to_be_bytes().to_vec()];
        assert_eq!(value(b'f', 4, &single).unwrap(), [[1.5]]);
        assert_eq!(value(b'd', 8, &double).unwrap(), [[1.5]]);
        for (kind, element_bytes) in [(b'c', 1), (b'?', 4), (b's', 3), (b's', 0)] {
            assert!(value(kind, element_bytes, &[0; 6]).is_err());
        }
    }

    #[test]
    fn a_value_that_is_cut_off_is_an_error() {
        let list: Vec<_> = KlvList(b"GYROs\x06\x00\x02\0\0\0\0").collect();
        assert!(matches!(list.as_slice(), [Err(what)] if what.contains("`GYRO` has 12 bytes")));
        assert!(KlvList(b"GYRO").next().is_none());
    }
}
