//! Little-endian numbers and names of binary files, read in order.

use std::io::{self, BufReader, ErrorKind, Read};
use std::path::Path;

use super::regular::open_regular;

/// Longest name in a binary file, bytes: more than the longest path of Linux.
const MAX_NAME_BYTES: usize = 1 << 13;

/// A binary file that is read from its start to its end; it is never held in the memory as a whole.
pub struct BinaryFile {
    reader: BufReader<std::fs::File>,
    at: u64,
    size: u64,
}

impl BinaryFile {
    /// Opens a regular file.
    ///
    /// # Errors
    /// The errors of [`open_regular`].
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = open_regular(path)?;
        Ok(Self {
            size: file.metadata()?.len(),
            reader: BufReader::new(file),
            at: 0,
        })
    }

    /// Position of the next byte, from 0.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Reads a byte.
    ///
    /// # Errors
    /// A file that ends before; an error of the operating system.
    pub fn u8(&mut self) -> io::Result<u8> {
        Ok(u8::from_le_bytes(self.bytes()?))
    }

    /// Reads an unsigned number of 4 bytes.
    ///
    /// # Errors
    /// A file that ends before; an error of the operating system.
    pub fn u32(&mut self) -> io::Result<u32> {
        Ok(u32::from_le_bytes(self.bytes()?))
    }

    /// Reads a signed number of 4 bytes.
    ///
    /// # Errors
    /// A file that ends before; an error of the operating system.
    pub fn i32(&mut self) -> io::Result<i32> {
        Ok(i32::from_le_bytes(self.bytes()?))
    }

    /// Reads an unsigned number of 8 bytes.
    ///
    /// # Errors
    /// A file that ends before; an error of the operating system.
    pub fn u64(&mut self) -> io::Result<u64> {
        Ok(u64::from_le_bytes(self.bytes()?))
    }

    /// Reads N floating-point numbers of 8 bytes; they need not be finite.
    ///
    /// # Errors
    /// A file that ends before; an error of the operating system.
    pub fn f64s<const N: usize>(&mut self) -> io::Result<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_le_bytes(self.bytes()?);
        }
        Ok(values)
    }

    /// Reads the number of records that follow, each of at least `min_bytes`.
    ///
    /// # Errors
    /// More records than the rest of the file has room for; the errors of [`BinaryFile::u64`].
    pub fn count(&mut self, min_bytes: u64) -> io::Result<usize> {
        let start = self.at;
        let count = self.u64()?;
        let room = (self.size - self.at) / min_bytes.max(1);
        match usize::try_from(count) {
            Ok(fitting) if count <= room => Ok(fitting),
            _ => Err(invalid(format!(
                "byte {start}: {count} entries cannot be in a file of {} bytes, which is damaged \
                 or cut off",
                self.size
            ))),
        }
    }

    /// Reads a text of UTF-8 up to a byte of zero.
    ///
    /// # Errors
    /// A longer text than any path is; one that is not UTF-8; a file that ends before.
    pub fn name(&mut self) -> io::Result<String> {
        let start = self.at;
        let mut name = Vec::new();
        loop {
            match self.bytes::<1>()? {
                [0] => break,
                [byte] => name.push(byte),
            }
            if name.len() > MAX_NAME_BYTES {
                return Err(invalid(format!(
                    "byte {start}: a name of more than {MAX_NAME_BYTES} bytes"
                )));
            }
        }
        String::from_utf8(name)
            .map_err(|_| invalid(format!("byte {start}: a name that is not UTF-8 text")))
    }

    /// Skips bytes.
    ///
    /// # Errors
    /// A file that ends before; an error of the operating system.
    pub fn skip(&mut self, bytes: u64) -> io::Result<()> {
        let step = i64::try_from(bytes).map_err(|_| self.cut_off())?;
        if bytes > self.size - self.at {
            return Err(self.cut_off());
        }
        self.reader.seek_relative(step)?;
        self.at += bytes;
        Ok(())
    }

    /// Checks that nothing follows.
    ///
    /// # Errors
    /// Further bytes.
    pub fn end(&self) -> io::Result<()> {
        if self.at == self.size {
            Ok(())
        } else {
            Err(invalid(format!(
                "byte {}: {} bytes follow the last entry",
                self.at,
                self.size - self.at
            )))
        }
    }

    /// Reads N bytes.
    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        // The size counts, and not the file, which may grow.
        if N as u64 > self.size - self.at {
            return Err(self.cut_off());
        }
        self.reader
            .read_exact(&mut bytes)
            .map_err(|error| match error.kind() {
                ErrorKind::UnexpectedEof => self.cut_off(),
                _ => error,
            })?;
        self.at += N as u64;
        Ok(bytes)
    }

    fn cut_off(&self) -> io::Error {
        invalid(format!(
            "byte {}: the file is cut off after {} bytes",
            self.at, self.size
        ))
    }
}

/// An error of the content, at a byte of the file.
fn invalid(what: String) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(content: &[u8]) -> BinaryFile {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.bin");
        std::fs::write(&path, content).unwrap();
        BinaryFile::open(&path).unwrap()
    }

    #[test]
    fn numbers_and_names_are_read_in_order() {
        let mut content = 7u32.to_le_bytes().to_vec();
        content.extend((-1i32).to_le_bytes());
        content.extend(1.5f64.to_le_bytes());
        content.extend(b"a\xc3\xbc.png\0skip");
        let mut file = file(&content);
        assert_eq!((file.u32().unwrap(), file.i32().unwrap()), (7, -1));
        assert_eq!(file.f64s().unwrap(), [1.5]);
        assert_eq!(file.name().unwrap(), "aü.png");
        assert!(file.end().unwrap_err().to_string().contains("4 bytes"));
        file.skip(4).unwrap();
        file.end().unwrap();
        let message = file.u32().unwrap_err().to_string();
        assert!(
            message.contains("byte 28: the file is cut off"),
            "{message}"
        );
    }

    #[test]
    fn a_count_is_no_larger_than_the_file_has_room_for() {
        let mut content = u64::MAX.to_le_bytes().to_vec();
        content.extend([0; 64]);
        let message = file(&content).count(64).unwrap_err().to_string();
        assert!(message.starts_with("byte 0: 18446744073709551615 entries"));
        content[..8].copy_from_slice(&1u64.to_le_bytes());
        assert_eq!(file(&content).count(64).unwrap(), 1);
        assert!(file(&content).count(65).is_err());
        let mut whole = file(&content);
        assert!(whole.skip(73).is_err() && whole.skip(u64::MAX).is_err());
    }

    #[test]
    fn a_name_without_end_is_refused() {
        let message = file(&[b'a'; 10_000]).name().unwrap_err().to_string();
        assert!(message.contains("more than 8192 bytes"), "{message}");
        assert!(
            file(b"ab")
                .name()
                .unwrap_err()
                .to_string()
                .contains("cut off")
        );
        assert!(file(b"\xff\0").name().is_err());
    }
}
