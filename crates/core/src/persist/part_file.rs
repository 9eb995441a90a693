//! Parts of a result that one run hands over to another.
//!
//! A part is stored as a state of a checkpoint is ([`super::checkpoint`]), behind the [`Origin`] of
//! the run that made it: another run takes it over only if it is of the same program, options and
//! inputs.

use super::atomic::WriteError;
use super::checkpoint::Origin;
use super::hashed_file;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::printed;

/// A part that cannot be taken over.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PartError {
    /// It cannot be read.
    #[error("{}: {source}", printed(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// It is damaged, or no part.
    #[error("{}: it is damaged ({what}); make it again", printed(path))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The problem.
        what: String,
    },
    /// It is of another run.
    #[error(
        "{}: it is a part of another result: {what}; make it again",
        printed(path)
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// The difference.
        what: String,
    },
}

/// Writes a part of the result of the run `origin`.
///
/// # Errors
/// An error of the operating system.
pub fn write_part(path: &Path, origin: &Origin, part: &impl Serialize) -> Result<(), WriteError> {
    hashed_file::write(path, |writer| {
        let text = serde_json::to_string(origin)?;
        postcard::to_io(&text, &mut *writer).map_err(io::Error::other)?;
        postcard::to_io(part, writer).map_err(io::Error::other)?;
        Ok(())
    })
}

/// Reads a part of the result of the run `origin`.
///
/// # Errors
/// [`PartError`].
pub fn read_part<P: DeserializeOwned>(path: &Path, origin: &Origin) -> Result<P, PartError> {
    let damaged = |what: String| PartError::Damaged {
        path: path.to_owned(),
        what,
    };
    let failed = |source: io::Error| PartError::Read {
        path: path.to_owned(),
        source,
    };
    let content = match hashed_file::read(path) {
        Ok(Some(content)) => content,
        Ok(None) => return Err(failed(ErrorKind::NotFound.into())),
        Err(error) if error.kind() == ErrorKind::InvalidData => {
            return Err(damaged(error.to_string()));
        }
        Err(error) => return Err(failed(error)),
    };
    let (text, part): (String, &[u8]) =
        postcard::take_from_bytes(&content).map_err(|error| damaged(error.to_string()))?;
    let made: Origin = serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
    // Only the program that wrote it reads what follows.
    if let Some(what) = made.difference(origin) {
        return Err(PartError::Other {
            path: path.to_owned(),
            what,
        });
    }
    match postcard::take_from_bytes(part) {
        Ok((part, [])) => Ok(part),
        Ok(_) => Err(damaged("it is too long".to_owned())),
        Err(error) => Err(damaged(error.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin(options: &str) -> Origin {
        Origin {
            program: "program 1".to_owned(),
            options: options.to_owned(),
            survey: String::new(),
            inputs: Vec::new(),
        }
    }

    #[test]
    fn a_part_is_read_by_runs_of_the_same_result_only() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("part");
        let part = vec![(3usize, 0.1f64), (4, f64::MIN_POSITIVE)];
        write_part(&path, &origin("a"), &part).unwrap();
        let read = |options: &str| read_part::<Vec<(usize, f64)>>(&path, &origin(options));
        assert_eq!(read("a").unwrap(), part);
        let error = read("b").unwrap_err().to_string();
        assert!(error.contains("its options differ"), "{error}");
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[20] ^= 1;
        std::fs::write(&path, bytes).unwrap();
        let error = read("a").unwrap_err().to_string();
        assert!(error.contains("hash does not match"), "{error}");
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(read("a"), Err(PartError::Read { .. })));
    }
}
