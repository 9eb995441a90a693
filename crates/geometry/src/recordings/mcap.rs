//! MCAP: records `opcode (1 byte), length (8 bytes), content`, between two magic numbers.
//!
//! | opcode | content |
//! | --- | --- |
//! | 3 schema | id (2), name, encoding, definition |
//! | 4 channel | id (2), id of its schema (2), topic, encoding of messages, … |
//! | 5 message | id of its channel (2), number (4), two times (8 each), the message |
//! | 6 chunk | two times (8 each), unpacked size (8), CRC-32 (4), compression, packed size (8), records |
//! | 15 end of the data | |
//!
//! Other records are skipped. All numbers are little-endian. Source: the MCAP format
//! specification, mcap.dev.

use super::chunk::{Compression, unpacked_size};
use super::error::RecordingError;
use super::fields::Fields;
use super::index::Index;
use super::place::{Chunk, Origin};
use super::record_file::RecordFile;
use super::topic::Wire;
use std::collections::HashMap;
use std::path::Path;

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const DATA_END: u8 = 15;
/// Bytes of a record before its content.
const RECORD_HEADER_BYTES: usize = 9;
const REMEDY: &str = "copy it anew, or save what is left of it by `mcap recover FILE --output NEW`";

/// Reads the index of an MCAP file, from its start until `is_enough`, or its end.
///
/// # Errors
/// An unreadable, damaged or cut-off file.
pub(super) fn read_index(
    path: &Path,
    is_enough: impl Fn(&Index) -> bool,
) -> Result<Index, RecordingError> {
    let mut file = RecordFile::open(path, REMEDY)?;
    if file.array::<8>()? != MAGIC {
        return Err(file.damaged("it does not begin as MCAP files do"));
    }
    let mut walk = Walk::default();
    loop {
        let [opcode, length @ ..] = file.array::<RECORD_HEADER_BYTES>()?;
        let length = u64::from_le_bytes(length);
        match opcode {
            DATA_END => return Ok(walk.index),
            SCHEMA | CHANNEL | MESSAGE | CHUNK => {
                let position = file.at();
                let content = file.bytes(length)?;
                walk.take_from_file(opcode, &content, position)
                    .map_err(|what| file.damaged(what))?;
                if is_enough(&walk.index) {
                    return Ok(walk.index);
                }
            }
            _ => file.skip(length)?,
        }
    }
}

/// The index and the schemas, as far as they are read.
#[derive(Default)]
struct Walk {
    index: Index,
    /// Names of the schemas.
    schemas: HashMap<u16, String>,
}

impl Walk {
    /// Takes a record of the file, whose content begins at `position`.
    fn take_from_file(&mut self, opcode: u8, content: &[u8], position: u64) -> Result<(), String> {
        if opcode != CHUNK {
            return self.take(opcode, content, Origin::File(position));
        }
        let (chunk, packed, crc) = read_chunk(content, position)?;
        let unpacked = chunk.compression.unpack(packed, chunk.unpacked_bytes)?;
        if crc != 0 && crc != crc32fast::hash(&unpacked) {
            return Err("a chunk's check sum is wrong".to_owned());
        }
        let number = self.index.chunks.len();
        self.index.chunks.push(chunk);
        let mut records = Fields::packed(&unpacked);
        while !records.rest().is_empty() {
            let (opcode, length) = (records.u8()?, records.u64()?);
            let length = usize::try_from(length).map_err(|error| error.to_string())?;
            let at = records.at();
            let origin = chunk.origin(number, at);
            self.take(opcode, records.take(length)?, origin)?;
        }
        Ok(())
    }

    /// Takes a schema, channel or message; other records of a chunk have no meaning.
    fn take(&mut self, opcode: u8, content: &[u8], origin: Origin) -> Result<(), String> {
        let mut fields = Fields::packed(content);
        match opcode {
            SCHEMA => {
                let id = fields.u16()?;
                self.schemas.insert(id, fields.text()?.to_owned());
            }
            CHANNEL => {
                let (id, schema) = (fields.u16()?, fields.u16()?);
                let (topic, encoding) = (fields.text()?, fields.text()?);
                let name = self.schemas.get(&schema).map_or("", String::as_str);
                let wire = match encoding {
                    "cdr" => Some(Wire::Cdr),
                    "ros1" => Some(Wire::Ros1),
                    _ => None,
                };
                self.index.add_channel(id.into(), topic, name, wire)?;
            }
            MESSAGE => {
                let channel = fields.u16()?;
                // A number and two times; the time that counts is in the message.
                fields.take(4 + 8 + 8)?;
                let message = fields.rest();
                let place = origin.place(fields.at(), message.len());
                self.index.add_message(channel.into(), place, message)?;
            }
            _ => {}
        }
        Ok(())
    }
}

/// Reads a chunk's description, its packed bytes and the CRC-32 of the unpacked ones, which is 0 if
/// there is none; its content begins at `position`.
fn read_chunk(content: &[u8], position: u64) -> Result<(Chunk, &[u8], u32), String> {
    let mut fields = Fields::packed(content);
    fields.take(8 + 8)?;
    let unpacked_bytes = unpacked_size(fields.u64()?)?;
    let crc = fields.u32()?;
    let compression = Compression::of(fields.text()?)?;
    let bytes = usize::try_from(fields.u64()?).map_err(|error| error.to_string())?;
    let start = fields.at();
    let packed = fields.take(bytes)?;
    let chunk = Chunk {
        position: position + start as u64,
        bytes,
        unpacked_bytes,
        compression,
    };
    Ok((chunk, packed, crc))
}
