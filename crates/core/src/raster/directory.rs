//! The header and the directories of a BigTIFF file.

/// The values of a tag.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Ascii(String),
    Short(Vec<u16>),
    Long(Vec<u32>),
    Rational(Vec<[u32; 2]>),
    Double(Vec<f64>),
    Long8(Vec<u64>),
}

impl Values {
    /// The code of the type, the number of values, and their bytes.
    fn encode(&self) -> (u16, usize, Vec<u8>) {
        fn bytes<T, const N: usize>(values: &[T], of: impl Fn(&T) -> [u8; N]) -> Vec<u8> {
            values.iter().flat_map(of).collect()
        }
        match self {
            Self::Ascii(text) => {
                let text = [text.as_bytes(), &[0]].concat();
                (2, text.len(), text)
            }
            Self::Short(values) => (3, values.len(), bytes(values, |value| value.to_le_bytes())),
            Self::Long(values) => (4, values.len(), bytes(values, |value| value.to_le_bytes())),
            Self::Rational(values) => {
                let parts: Vec<u32> = values.iter().copied().flatten().collect();
                (5, values.len(), bytes(&parts, |part| part.to_le_bytes()))
            }
            Self::Double(values) => (12, values.len(), bytes(values, |value| value.to_le_bytes())),
            Self::Long8(values) => (16, values.len(), bytes(values, |value| value.to_le_bytes())),
        }
    }
}

/// Numbers of tags.
pub(super) mod tag {
    pub const NEW_SUBFILE_TYPE: u16 = 254;
    pub const IMAGE_WIDTH: u16 = 256;
    pub const IMAGE_LENGTH: u16 = 257;
    pub const BITS_PER_SAMPLE: u16 = 258;
    pub const COMPRESSION: u16 = 259;
    pub const PHOTOMETRIC_INTERPRETATION: u16 = 262;
    pub const SAMPLES_PER_PIXEL: u16 = 277;
    pub const PLANAR_CONFIGURATION: u16 = 284;
    pub const PREDICTOR: u16 = 317;
    pub const TILE_WIDTH: u16 = 322;
    pub const TILE_LENGTH: u16 = 323;
    pub const TILE_OFFSETS: u16 = 324;
    pub const TILE_BYTE_COUNTS: u16 = 325;
    pub const EXTRA_SAMPLES: u16 = 338;
    pub const SAMPLE_FORMAT: u16 = 339;
    pub const YCBCR_SUBSAMPLING: u16 = 530;
    pub const REFERENCE_BLACK_WHITE: u16 = 532;
    pub const MODEL_TRANSFORMATION: u16 = 34264;
    pub const GEO_KEY_DIRECTORY: u16 = 34735;
    pub const GEO_ASCII_PARAMS: u16 = 34737;
    pub const GDAL_METADATA: u16 = 42112;
    pub const GDAL_NODATA: u16 = 42113;
}

/// Tags and their values, in ascending order of the tags.
pub(super) type Directory = Vec<(u16, Values)>;

/// Largest size of values stored in the directory itself, bytes.
const MAX_INLINE_BYTES: usize = 8;

/// Encodes the header, the `ghost` area and the directories of a BigTIFF file. The tile offsets
/// come last, so that the first part of the file contains all directories.
///
/// The length depends on the number of values only.
pub(super) fn encode(ghost: &str, directories: &[Directory]) -> Vec<u8> {
    let mut out = b"II\x2b\0\x08\0\0\0".to_vec();
    let mut link = out.len();
    out.extend([0; 8]);
    out.extend(ghost.as_bytes());
    align(&mut out);
    let mut late = Vec::new();
    for directory in directories {
        let start = out.len();
        set(&mut out, link, start);
        out.extend((directory.len() as u64).to_le_bytes());
        let mut values = Vec::new();
        let after = start + 8 + 20 * directory.len() + 8;
        for (tag, of_tag) in directory {
            let (kind, count, mut bytes) = of_tag.encode();
            out.extend(tag.to_le_bytes());
            out.extend(kind.to_le_bytes());
            out.extend((count as u64).to_le_bytes());
            if bytes.len() <= MAX_INLINE_BYTES {
                bytes.resize(MAX_INLINE_BYTES, 0);
                out.extend(bytes);
                continue;
            }
            if matches!(*tag, tag::TILE_OFFSETS | tag::TILE_BYTE_COUNTS) {
                late.push((out.len(), bytes));
                out.extend([0; 8]);
            } else {
                out.extend(((after + values.len()) as u64).to_le_bytes());
                values.extend(bytes);
                align(&mut values);
            }
        }
        link = out.len();
        out.extend([0; 8]);
        out.extend(values);
    }
    for (place, bytes) in late {
        let start = out.len();
        set(&mut out, place, start);
        out.extend(bytes);
        align(&mut out);
    }
    out
}

/// Pads to a multiple of eight bytes.
fn align(out: &mut Vec<u8>) {
    out.resize(out.len().next_multiple_of(8), 0);
}

/// Writes an offset at `place`.
fn set(out: &mut [u8], place: usize, offset: usize) {
    out[place..place + 8].copy_from_slice(&(offset as u64).to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_does_not_depend_on_the_values() {
        let of = |offsets: Vec<u64>| {
            let one = vec![
                (tag::IMAGE_WIDTH, Values::Long(vec![7])),
                (tag::TILE_OFFSETS, Values::Long8(offsets)),
            ];
            encode("ghost", &[one.clone(), one])
        };
        let (few, many) = (of(vec![0; 3]), of(vec![u64::MAX; 3]));
        assert_eq!(few.len(), many.len());
        assert_eq!(few[8], 24, "the first directory comes after the ghost area");
        assert_eq!(few.len(), 24 + 2 * (8 + 2 * 20 + 8) + 2 * 24);
    }
}
