//! Files that are locked or appended to, and targets that may be replaced.

use super::regular::check_regular;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// Opens a file for reading and writing, and creates it if it is missing. Its content stays. A
/// symbolic link is refused: it could lead to a file of somebody else.
///
/// # Errors
/// An error of the operating system; a symbolic link or any other file that is not regular.
pub fn open_without_links(path: &Path) -> io::Result<File> {
    match path.symlink_metadata() {
        Ok(data) => check_regular(data.file_type())?,
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    follow_no_link(&mut options);
    let file = options.open(path)?;
    check_regular(file.metadata()?.file_type())?;
    Ok(file)
}

/// Writes a file and replaces its content. A symbolic link is refused.
///
/// # Errors
/// The errors of [`open_without_links`].
pub fn write_without_links(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = open_without_links(path)?;
    file.set_len(0)?;
    file.write_all(bytes)
}

/// Checks that a file may be replaced: that it is missing, a regular file, or a link to such a one.
///
/// # Errors
/// An existing folder, device, named pipe or socket.
pub fn check_replaceable_file(path: &Path) -> io::Result<()> {
    match path.metadata() {
        Ok(data) => check_regular(data.file_type()),
        // Missing, or a link that leads nowhere; other problems appear when the file is written.
        Err(_) => Ok(()),
    }
}

#[cfg(unix)]
fn follow_no_link(options: &mut OpenOptions) {
    use std::os::unix::fs::OpenOptionsExt;
    options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK | libc::O_NOCTTY);
}

#[cfg(not(unix))]
fn follow_no_link(_options: &mut OpenOptions) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_stays_when_a_file_is_opened() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lock");
        open_without_links(&path).unwrap();
        std::fs::write(&path, "kept").unwrap();
        open_without_links(&path).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "kept");
        check_replaceable_file(&path).unwrap();
        check_replaceable_file(&dir.path().join("new")).unwrap();
        assert!(check_replaceable_file(dir.path()).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let (precious, link) = (dir.path().join("precious"), dir.path().join("lock"));
        std::fs::write(&precious, "kept").unwrap();
        std::os::unix::fs::symlink(&precious, &link).unwrap();
        let error = open_without_links(&link).unwrap_err().to_string();
        assert!(error.contains("a symbolic link"), "{error}");
        assert_eq!(std::fs::read_to_string(&precious).unwrap(), "kept");
        let error = check_replaceable_file(Path::new("/dev/null")).unwrap_err();
        assert!(error.to_string().contains("a device"), "{error}");
    }
}
