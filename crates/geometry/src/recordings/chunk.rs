//! Unpacking of chunks.

use std::borrow::Cow;
use std::io::{self, Read};

/// Largest chunk, packed or not, and largest message, bytes. Recorders write chunks of about a
/// megabyte, or of one message that is larger: an image of 16 bits and 100 megapixels has 600 MB.
pub const MAX_CHUNK_BYTES: u64 = 1 << 30;

/// The unpacked size of a chunk that states so many bytes.
///
/// # Errors
/// More than are read, in words.
pub fn unpacked_size(stated: u64) -> Result<usize, String> {
    let size = usize::try_from(stated).ok();
    size.filter(|_| stated <= MAX_CHUNK_BYTES).ok_or_else(|| {
        format!("a chunk states {stated} bytes, more than the {MAX_CHUNK_BYTES} that are read")
    })
}

/// The ways that chunks are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    None,
    /// Frames of LZ4.
    Lz4,
    /// Frames of Zstandard.
    Zstd,
    /// A stream of bzip2.
    Bz2,
}

impl Compression {
    /// The compression of a name in a file.
    ///
    /// # Errors
    /// A name that is not known, in words.
    pub fn of(name: &str) -> Result<Self, String> {
        match name {
            "" | "none" => Ok(Self::None),
            "lz4" => Ok(Self::Lz4),
            "zstd" => Ok(Self::Zstd),
            "bz2" => Ok(Self::Bz2),
            other => Err(format!(
                "chunks packed by {other:?} are not read; known are lz4, zstd and bz2"
            )),
        }
    }

    /// Unpacks a chunk, whose unpacked size must be `expected`.
    ///
    /// # Errors
    /// Damaged bytes, or more or fewer of them, in words.
    pub fn unpack(self, packed: &[u8], expected: usize) -> Result<Cow<'_, [u8]>, String> {
        let unpacked = match self {
            Self::None => Ok(Cow::Borrowed(packed)),
            Self::Lz4 => read(lz4_flex::frame::FrameDecoder::new(packed), expected),
            Self::Bz2 => read(bzip2::read::BzDecoder::new(packed), expected),
            Self::Zstd => ruzstd::decoding::StreamingDecoder::new(packed)
                .map_err(|error| io::Error::other(error.to_string()))
                .and_then(|decoder| read(decoder, expected)),
        };
        let unpacked = unpacked.map_err(|error| format!("its bytes are damaged ({error})"))?;
        if unpacked.len() != expected {
            return Err(format!(
                "it has not the {expected} bytes that it states, unpacked"
            ));
        }
        Ok(unpacked)
    }
}

/// Reads what a decoder gives, and no more than a byte above what is expected.
fn read(decoder: impl Read, expected: usize) -> io::Result<Cow<'static, [u8]>> {
    let mut unpacked = Vec::new();
    let most = (expected as u64).saturating_add(1);
    decoder.take(most).read_to_end(&mut unpacked)?;
    Ok(Cow::Owned(unpacked))
}
