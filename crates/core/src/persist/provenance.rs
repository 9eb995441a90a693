//! Provenance of results: hashes of the input files.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::open_regular;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// A file that cannot be hashed.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot read: {source}", printed(path))]
pub struct HashError {
    /// The file.
    pub path: PathBuf,
    /// The error of the operating system.
    pub source: std::io::Error,
}

/// An input and the BLAKE3 hash of its content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// The file as named by the user, or the folder of the frames.
    pub path: PathBuf,
    /// Number of files, for frames or a folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub files: Option<usize>,
    /// Hexadecimal BLAKE3: of the file, or of several files' names and hashes in their order.
    pub blake3: String,
}

fn hash_file(path: &Path) -> Result<blake3::Hash, HashError> {
    let fail = |source| HashError {
        path: path.to_owned(),
        source,
    };
    let mut hasher = blake3::Hasher::new();
    let file = open_regular(path).map_err(fail)?;
    hasher.update_reader(file).map_err(fail)?;
    Ok(hasher.finalize())
}

/// Combines the names (without folders) and hashes of files, in order, to one hash; files are read
/// in parallel.
fn hash_files(paths: &[&Path]) -> Result<blake3::Hash, HashError> {
    let hashes: Vec<blake3::Hash> = paths
        .par_map(|path| hash_file(path))
        .into_iter()
        .collect::<Result<_, _>>()?;
    let mut all = blake3::Hasher::new();
    for (path, hash) in paths.iter().zip(&hashes) {
        let name = path.file_name().unwrap_or_default();
        // Names contain no zero byte and hashes have a fixed length, so different lists cannot
        // collide by concatenation.
        all.update(name.as_encoded_bytes()).update(&[0]);
        all.update(hash.as_bytes());
    }
    Ok(all.finalize())
}

/// Hashes a file, or the files of a folder (a COLMAP model), sorted by name.
///
/// # Errors
/// [`HashError`] if it cannot be read.
pub fn input(path: &Path) -> Result<Input, HashError> {
    let fail = |source| HashError {
        path: path.to_owned(),
        source,
    };
    let (files, hash) = if !path.is_dir() {
        (None, hash_file(path)?)
    } else {
        let entries = std::fs::read_dir(path).map_err(fail)?;
        let inner: Result<Vec<PathBuf>, _> = entries.map(|entry| Ok(entry?.path())).collect();
        let mut inner = inner.map_err(fail)?;
        inner.retain(|path| path.is_file());
        inner.sort();
        let inner: Vec<&Path> = inner.iter().map(PathBuf::as_path).collect();
        (Some(inner.len()), hash_files(&inner)?)
    };
    Ok(Input {
        path: path.to_owned(),
        files,
        blake3: hash.to_hex().to_string(),
    })
}

/// Hashes a list of files of one folder, in their order.
///
/// # Errors
/// [`HashError`] of the first that cannot be read.
pub fn input_list(paths: &[&Path]) -> Result<Input, HashError> {
    let folder = paths.first().and_then(|path| path.parent());
    Ok(Input {
        path: folder.unwrap_or(Path::new("")).to_owned(),
        files: Some(paths.len()),
        blake3: hash_files(paths)?.to_hex().to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_follow_content_names_and_order() {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str, content: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, content).unwrap();
            path
        };
        let (a, b) = (file("a.png", "one"), file("b.png", "two"));
        let both = input_list(&[&a, &b]).unwrap();
        assert_eq!(both.files, Some(2));
        assert_ne!(both, input_list(&[&b, &a]).unwrap());
        let c = file("c.png", "one");
        assert_ne!(both.blake3, input_list(&[&c, &b]).unwrap().blake3);
        assert_eq!(
            input(&a).unwrap().blake3,
            blake3::hash(b"one").to_hex().to_string()
        );
        file("a.png", "other");
        assert_ne!(both, input_list(&[&a, &b]).unwrap());
        assert!(input(&dir.path().join("none")).is_err());
    }
}
