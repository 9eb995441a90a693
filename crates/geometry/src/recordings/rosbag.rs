//! Bags of ROS 1, version 2.0: records `length (4 bytes), header, length (4 bytes), data` after a
//! first line. A header is a list of fields `length (4 bytes), name=value`; its field `op` tells
//! the kind of the record.
//!
//! | op | fields of the header | data |
//! | --- | --- | --- |
//! | 2 message | `conn` (4) | the message |
//! | 3 bag header | `chunk_count` (4) | padding |
//! | 5 chunk | `compression`, `size` (4), unpacked | records |
//! | 7 connection | `conn` (4), `topic` | fields, of which `type` is the type of its messages |
//!
//! Other records are skipped. All numbers are little-endian. Source: the ROS wiki,
//! "Bags/Format/2.0".

use super::chunk::{Compression, unpacked_size};
use super::error::RecordingError;
use super::fields::Fields;
use super::index::Index;
use super::place::{Chunk, Origin};
use super::record_file::RecordFile;
use super::topic::Wire;
use std::path::Path;

const MAGIC: [u8; 13] = *b"#ROSBAG V2.0\n";
const MESSAGE: u8 = 2;
const BAG_HEADER: u8 = 3;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;
const REMEDY: &str = "copy it anew, or save what is left of it by `rosbag reindex FILE`";

/// Reads the index of a bag, from its start until `is_enough`, or its end.
///
/// # Errors
/// An unreadable, damaged or cut-off file.
pub(super) fn read_index(
    path: &Path,
    is_enough: impl Fn(&Index) -> bool,
) -> Result<Index, RecordingError> {
    let mut file = RecordFile::open(path, REMEDY)?;
    if file.array()? != MAGIC {
        return Err(file.damaged("it does not begin as bags of version 2.0 do"));
    }
    let mut walk = Walk::default();
    while !file.is_at_end() {
        let length = u32::from_le_bytes(file.array()?);
        let header = file.bytes(length.into())?;
        let bytes = u64::from(u32::from_le_bytes(file.array()?));
        let op = op(&header).map_err(|what| file.damaged(what))?;
        match op {
            MESSAGE | BAG_HEADER | CHUNK | CONNECTION => {
                let position = file.at();
                let data = file.bytes(bytes)?;
                walk.take_from_file(op, &header, &data, position)
                    .map_err(|what| file.damaged(what))?;
                if is_enough(&walk.index) {
                    return Ok(walk.index);
                }
            }
            _ => file.skip(bytes)?,
        }
    }
    if walk.chunks < walk.stated_chunks {
        return Err(file.cut_off());
    }
    Ok(walk.index)
}

/// The index and the number of chunks, as far as they are read.
#[derive(Default)]
struct Walk {
    index: Index,
    chunks: u32,
    /// The number of chunks that the bag's header states; 0 if the bag was not closed.
    stated_chunks: u32,
}

impl Walk {
    /// Takes a record of the file, whose data begin at `position`.
    fn take_from_file(
        &mut self,
        op: u8,
        header: &[u8],
        data: &[u8],
        position: u64,
    ) -> Result<(), String> {
        match op {
            CHUNK => self.take_chunk(header, data, position),
            BAG_HEADER => {
                self.stated_chunks = Fields::packed(field(header, "chunk_count")?).u32()?;
                Ok(())
            }
            _ => self.take(op, header, data, Origin::File(position)),
        }
    }

    /// Takes the records of a chunk.
    fn take_chunk(&mut self, header: &[u8], packed: &[u8], position: u64) -> Result<(), String> {
        let name = String::from_utf8_lossy(field(header, "compression")?);
        let stated = Fields::packed(field(header, "size")?).u32()?;
        let chunk = Chunk {
            position,
            bytes: packed.len(),
            unpacked_bytes: unpacked_size(stated.into())?,
            compression: Compression::of(&name)?,
        };
        let unpacked = chunk.compression.unpack(packed, chunk.unpacked_bytes)?;
        self.chunks += 1;
        let number = self.index.chunks.len();
        self.index.chunks.push(chunk);
        let mut records = Fields::packed(&unpacked);
        while !records.rest().is_empty() {
            let (header, data) = (records.byte_list()?, records.byte_list()?);
            let at = records.at() - data.len();
            self.take(op(header)?, header, data, chunk.origin(number, at))?;
        }
        Ok(())
    }

    /// Takes a connection or a message; other records have no meaning in a chunk.
    fn take(&mut self, op: u8, header: &[u8], data: &[u8], origin: Origin) -> Result<(), String> {
        if !matches!(op, CONNECTION | MESSAGE) {
            return Ok(());
        }
        let connection = Fields::packed(field(header, "conn")?).u32()?;
        if op == CONNECTION {
            let text = |bytes| {
                std::str::from_utf8(bytes).map_err(|_| "a name that is not UTF-8".to_owned())
            };
            let topic = text(field(header, "topic")?)?;
            let kind = text(field(data, "type")?)?;
            let wire = Some(Wire::Ros1);
            return self.index.add_channel(connection, topic, kind, wire);
        }
        let place = origin.place(0, data.len());
        self.index.add_message(connection, place, data)
    }
}

/// The kind of a record by its header.
fn op(header: &[u8]) -> Result<u8, String> {
    Fields::packed(field(header, "op")?).u8()
}

/// The value of a field.
///
/// # Errors
/// No such field, or fields that end too early.
fn field<'a>(header: &'a [u8], name: &str) -> Result<&'a [u8], String> {
    let mut fields = Fields::packed(header);
    while !fields.rest().is_empty() {
        let field = fields.byte_list()?;
        let value = field.strip_prefix(name.as_bytes());
        if let Some(value) = value.and_then(|value| value.strip_prefix(b"=")) {
            return Ok(value);
        }
    }
    Err(format!("a record without the field {name:?}"))
}
