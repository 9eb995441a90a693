//! Folders with a file for each pose: the matrix `[R t; 0 0 0 1]`, camera-to-world, metres, as
//! ScanNet (`pose/0.txt`) and 7-Scenes (`frame-000000.pose.txt`) have it. `[R t]` is read, too.
//!
//! The files are taken in natural order of their names, as frames are.

use super::error::PoseError;
use super::kitti;
use super::pose_entry::PoseEntry;
use super::text;
use alphanumeric_sort::compare_path;
use std::path::{Path, PathBuf};

/// Extension of the files.
const EXTENSION: &str = "txt";

/// Reads the poses of a folder.
///
/// # Errors
/// A folder that cannot be read or has none of these files; a file that cannot be read, or that
/// does not hold one matrix of a rigid motion.
pub(super) fn read(folder: &Path) -> Result<Vec<PoseEntry>, PoseError> {
    let files = matrix_files(folder).map_err(|source| PoseError::Read {
        path: folder.to_owned(),
        source,
    })?;
    if files.is_empty() {
        let what = "holds no poses: neither a model of COLMAP (images.txt or images.bin) nor files \
                    named *.txt with a 4 × 4 matrix each";
        return Err(PoseError::file(folder, what));
    }
    files.iter().map(|file| read_matrix(file)).collect()
}

/// The files of a folder that may hold a matrix, in natural order.
fn matrix_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if is_matrix_file(&path) {
            files.push(path);
        }
    }
    files.sort_by(|a, b| compare_path(a, b));
    Ok(files)
}

/// True for the name of a file that may hold the matrix of a pose.
pub fn is_matrix_file(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    !name.starts_with('.') && path.extension().is_some_and(|found| found == EXTENSION)
}

/// Reads the matrix of a file, in however many lines it stands.
fn read_matrix(path: &Path) -> Result<PoseEntry, PoseError> {
    let text = text::read(path)?;
    let rows: Vec<&str> = text::lines(&text).map(|(_, line)| line).collect();
    kitti::parse_line(&rows.join(" ")).map_err(|what| PoseError::file(path, what))
}

#[cfg(test)]
mod tests {
    use crate::trajectory::{PoseFormat, read_poses};
    use nalgebra::Vector3;

    /// A folder with these files.
    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    const SECOND: &str = "0 -1 0 1\n1 0 0 2.5\n0 0 1 -3\n0 0 0 1\n";

    #[test]
    fn matrices_are_read_in_natural_order() {
        let tenth = SECOND.replace("2.5", "10");
        let files = [
            ("10.txt", tenth.as_str()),
            ("2.txt", SECOND),
            ("10.jpg", ""),
        ];
        let folder = folder(&files);
        let read = read_poses(folder.path(), None).unwrap();
        assert_eq!(read.format, PoseFormat::Kitti);
        let places: Vec<Vector3<f64>> = read.entries.iter().map(|e| e.pose.t_wc).collect();
        let [second, tenth] = [2.5, 10.0].map(|y| Vector3::new(1.0, y, -3.0));
        assert_eq!(places, [second, tenth]);
        let turned = read.entries[0].pose.r_wc * Vector3::x();
        assert!((turned - Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn a_file_that_holds_no_matrix_is_named() {
        let lost = "-inf -inf -inf -inf\n-inf -inf -inf -inf\n-inf -inf -inf -inf\n0 0 0 1\n";
        let folder_of =
            |second| folder(&[("frame-0.pose.txt", SECOND), ("frame-1.pose.txt", second)]);
        for (text, reason) in [
            (lost, "not finite"),
            ("1 2 3\n", "3 columns"),
            ("", "0 columns"),
        ] {
            let folder = folder_of(text);
            let error = read_poses(folder.path(), None).unwrap_err().to_string();
            assert!(
                error.contains("frame-1.pose.txt") && error.contains(reason),
                "{error}"
            );
        }
        let empty = folder(&[("picture.jpg", "")]);
        let error = read_poses(empty.path(), None).unwrap_err().to_string();
        assert!(error.contains("holds no poses"), "{error}");
    }
}
