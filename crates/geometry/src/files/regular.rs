//! Opening and reading of regular files.

use super::encoding::decode_text;
use super::standard_input;
use std::fs::{File, FileType, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// Opens a regular file for reading, and nothing else: a named pipe would wait for its writer, and
/// a device may have no end. Standard input is opened, too, if a command names it.
///
/// # Errors
/// An error of the operating system; a folder, named pipe, socket or device.
pub fn open_regular(path: &Path) -> io::Result<File> {
    if standard_input::is_standard_input(path) {
        return standard_input::open();
    }
    // Checked first, because opening alone has effects on some devices.
    check_regular(path.metadata()?.file_type())?;
    let mut options = OpenOptions::new();
    options.read(true);
    wait_for_nothing(&mut options);
    let file = options.open(path)?;
    // Checked again, because another file may have taken the name.
    check_regular(file.metadata()?.file_type())?;
    Ok(file)
}

/// Reads a regular file of at most `max_bytes`.
///
/// # Errors
/// The errors of [`open_regular`]; a file that is larger.
pub fn read_regular(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    read_limited(&open_regular(path)?, max_bytes)
}

/// Reads a regular text file of at most `max_bytes`.
///
/// # Errors
/// The errors of [`read_regular`]; a file that is no text that [`decode_text`] knows.
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<String> {
    let bytes = read_regular(path, max_bytes)?;
    decode_text(&bytes)
        .map_err(|what| io::Error::new(ErrorKind::InvalidData, format!("the file {what}")))
}

/// Reads an open file to its end, at most `max_bytes`.
///
/// # Errors
/// An error of the operating system; a file that is larger.
pub fn read_limited(file: &File, max_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    read_limited_into(file, max_bytes, &mut bytes)?;
    Ok(bytes)
}

/// Reads an open file to its end, at most `max_bytes`, into an empty buffer.
///
/// # Errors
/// The errors of [`read_limited`].
pub fn read_limited_into(file: &File, max_bytes: u64, bytes: &mut Vec<u8>) -> io::Result<()> {
    let too_large = || {
        let what = format!(
            "it is larger than {} MiB, the largest file of its kind that is read",
            max_bytes >> 20
        );
        io::Error::new(ErrorKind::FileTooLarge, what)
    };
    let size = file.metadata()?.len();
    if size > max_bytes {
        return Err(too_large());
    }
    let room = usize::try_from(size).map_err(|_| too_large())?;
    bytes.try_reserve_exact(room)?;
    // The file may have grown meanwhile.
    file.take(max_bytes.saturating_add(1)).read_to_end(bytes)?;
    if bytes.len() as u64 > max_bytes {
        return Err(too_large());
    }
    Ok(())
}

/// Checks that a file is a regular one.
///
/// # Errors
/// The kind of any other file.
pub(super) fn check_regular(kind: FileType) -> io::Result<()> {
    if kind.is_file() {
        return Ok(());
    }
    let what = if kind.is_dir() {
        "it is a folder, and a file is needed".to_owned()
    } else {
        format!("it is no regular file, but {}", kind_name(kind))
    };
    Err(io::Error::new(ErrorKind::InvalidInput, what))
}

#[cfg(unix)]
fn kind_name(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if kind.is_fifo() {
        "a named pipe"
    } else if kind.is_socket() {
        "a socket"
    } else if kind.is_symlink() {
        "a symbolic link"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn kind_name(kind: FileType) -> &'static str {
    if kind.is_symlink() {
        "a symbolic link"
    } else {
        "a device"
    }
}

#[cfg(unix)]
fn wait_for_nothing(options: &mut OpenOptions) {
    use std::os::unix::fs::OpenOptionsExt;
    options.custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY);
}

#[cfg(not(unix))]
fn wait_for_nothing(_options: &mut OpenOptions) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_their_limit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read_text(&path, 5).unwrap(), "12345");
        let error = read_text(&path, 4).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::FileTooLarge);
        std::fs::write(&path, [0x81]).unwrap();
        assert!(
            read_text(&path, 5)
                .unwrap_err()
                .to_string()
                .contains("UTF-8")
        );
        let missing = open_regular(&dir.path().join("b.txt")).unwrap_err();
        assert_eq!(missing.kind(), ErrorKind::NotFound);
        let error = open_regular(dir.path()).unwrap_err().to_string();
        assert!(error.contains("folder"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_are_refused_at_once() {
        let dir = tempfile::tempdir().unwrap();
        let link = dir.path().join("endless.tum");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        let error = read_text(&link, 10).unwrap_err().to_string();
        assert!(error.contains("no regular file, but a device"), "{error}");
        let pipe = dir.path().join("pipe.tum");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        if made.is_ok_and(|status| status.success()) {
            let error = open_regular(&pipe).unwrap_err().to_string();
            assert!(error.contains("a named pipe"), "{error}");
        }
    }
}
