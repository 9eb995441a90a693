//! Files that are complete or absent.

use super::error::WriteError;
use super::error_keeper::ErrorKeeper;
use super::output_set::OutputSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes the file `path` atomically; `fill` writes its content.
///
/// # Errors
/// An error of the operating system about the folder, writing or renaming.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<ErrorKeeper<File>>) -> std::io::Result<()>,
) -> Result<(), WriteError> {
    let mut set = OutputSet::default();
    set.write(path, fill)?;
    set.commit()
}

/// Writes a text file atomically; see [`write()`].
///
/// # Errors
/// The errors of [`write()`].
pub fn write_text(path: &Path, text: &str) -> Result<(), WriteError> {
    write(path, |writer| writer.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_litter() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_text(&path, "old").unwrap();
        let failed = write(&path, |writer| {
            writer.write_all(b"new")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk full"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_error_of_the_system_is_the_one_reported() {
        let mut writer = ErrorKeeper::new(File::options().write(true).open("/dev/full").unwrap());
        let failed = writer
            .write_all(b"x")
            .map_err(|_| std::io::Error::other("encoder"));
        assert!(failed.is_err());
        assert_eq!(
            writer.error.unwrap().kind(),
            std::io::ErrorKind::StorageFull
        );
    }
}
