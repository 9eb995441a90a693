//! Folders with a file for each pose.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::trajectory::{PoseFile, PoseFormat, is_matrix_file, read_poses};

/// Files from which on a folder is tried.
const MIN_FILES: usize = 2;

/// The folders among those of the `files` (relative to `folder`) of which each text holds the
/// matrix of a pose.
pub(super) fn matrix_folders(folder: &Path, files: &[PathBuf]) -> BTreeMap<PathBuf, PoseFile> {
    let mut counts: BTreeMap<&Path, usize> = BTreeMap::new();
    for file in files.iter().filter(|file| is_matrix_file(file)) {
        *counts.entry(parent(file)).or_default() += 1;
    }
    let several = counts.into_iter().filter(|(_, count)| *count >= MIN_FILES);
    several
        .filter_map(|(inner, _)| {
            let poses = read_poses(&folder.join(inner), Some(PoseFormat::Kitti)).ok()?;
            Some((inner.to_owned(), poses))
        })
        .collect()
}

/// True if a file is one of those of one of the folders found.
pub(super) fn holds(folders: &BTreeMap<PathBuf, PoseFile>, file: &Path) -> bool {
    is_matrix_file(file) && folders.contains_key(parent(file))
}

fn parent(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

#[cfg(test)]
mod tests {
    use crate::survey::Discovery;
    use std::path::Path;

    #[test]
    fn a_folder_of_matrices_is_found_and_one_with_other_texts_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let matrix = |x: usize| format!("1 0 0 {x}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        for k in 0..11 {
            write(&format!("pose/{k}.txt"), &matrix(k));
            write(&format!("notes/{k}.txt"), &matrix(k));
        }
        write("notes/readme.txt", "a survey\n");
        let found = Discovery::of(dir.path()).unwrap();
        let (path, poses) = found.initial().unwrap();
        assert_eq!((path.as_path(), found.poses.len()), (Path::new("pose"), 1));
        assert_eq!(poses.entries.len(), 11);
        assert_eq!(poses.entries[10].pose.t_wc.x, 10.0);
        assert!(!found.left_aside.is_empty());
    }
}
