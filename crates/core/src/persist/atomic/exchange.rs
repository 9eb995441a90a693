//! Exchange of two names.

use super::temporary::REPLACED_SUFFIX;
use std::io;
use std::path::Path;

/// Exchanges what two names of one disk mean; either may be missing. Its own inverse.
///
/// # Errors
/// An error of the operating system, after which both names mean what they did.
pub(super) fn exchange(a: &Path, b: &Path) -> io::Result<()> {
    match (is_there(a), is_there(b)) {
        (true, true) => match exchange_at_once(a, b) {
            Err(error) if is_unsupported(&error) => exchange_by_renames(a, b),
            done => done,
        },
        (true, false) => std::fs::rename(a, b),
        (false, true) => std::fs::rename(b, a),
        (false, false) => Ok(()),
    }
}

fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// The exchange as one operation of the file system.
#[cfg(any(target_os = "linux", target_os = "macos"))]
fn exchange_at_once(a: &Path, b: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
}

#[cfg(not(any(target_os = "linux", target_os = "macos")))]
fn exchange_at_once(_a: &Path, _b: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// True if the system or the disk knows no exchange.
fn is_unsupported(error: &io::Error) -> bool {
    use io::ErrorKind::{InvalidInput, Unsupported};
    matches!(error.kind(), InvalidInput | Unsupported)
}

/// The exchange in three steps. A program killed between them leaves `b` beside `a`, with
/// [`REPLACED_SUFFIX`] at its name.
fn exchange_by_renames(a: &Path, b: &Path) -> io::Result<()> {
    let mut aside = a.as_os_str().to_owned();
    aside.push(REPLACED_SUFFIX);
    std::fs::rename(b, &aside)?;
    if let Err(error) = std::fs::rename(a, b) {
        std::fs::rename(&aside, b)?;
        return Err(error);
    }
    std::fs::rename(&aside, a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_exchanged_and_exchanged_back() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| dir.path().join(name));
        let states = || [&a, &b].map(|path| std::fs::read_to_string(path).ok());
        for (of_a, of_b) in [
            (Some("1"), Some("2")),
            (Some("1"), None),
            (None, Some("2")),
            (None, None),
        ] {
            for (path, text) in [(&a, of_a), (&b, of_b)] {
                let _ = std::fs::remove_file(path);
                if let Some(text) = text {
                    std::fs::write(path, text).unwrap();
                }
            }
            let before = states();
            let [first, second] = before.clone();
            exchange(&a, &b).unwrap();
            assert_eq!(states(), [second, first]);
            exchange(&a, &b).unwrap();
            assert_eq!(states(), before);
        }
    }

    #[test]
    fn renames_exchange_files_and_folders() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| dir.path().join(name));
        for path in [&a, &b] {
            std::fs::create_dir(path).unwrap();
            std::fs::write(path.join(path.file_name().unwrap()), "").unwrap();
        }
        exchange_by_renames(&a, &b).unwrap();
        assert!(a.join("b").is_file() && b.join("a").is_file());
        // Where the second step fails, both are where they were.
        assert!(exchange_by_renames(&dir.path().join("missing"), &b).is_err());
        assert!(b.join("a").is_file());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
    }
}
