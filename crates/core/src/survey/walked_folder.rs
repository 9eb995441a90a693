//! The files of a folder in which the parts of a survey are searched for.

use std::path::{Path, PathBuf};

/// Levels of folders below the searched one.
const MAX_DEPTH: usize = 3;
/// File by which a folder of results of `refine` is recognised.
const REFINEMENT_FILE: &str = "refine.json";

/// The files below a folder, and what was not searched or cannot be read, with the reasons.
#[derive(Default)]
pub(super) struct WalkedFolder {
    /// The files, sorted, relative to the folder.
    pub files: Vec<PathBuf>,
    /// Folders and files that were not searched, with the reasons.
    pub unsearched: Vec<(PathBuf, String)>,
}

impl WalkedFolder {
    /// Lists a folder and three levels of folders below it, without hidden ones and without results
    /// of `refine`.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn of(folder: &Path) -> std::io::Result<Self> {
        let mut walked = Self::default();
        walk(folder, Path::new(""), MAX_DEPTH, &mut walked)?;
        walked.files.sort();
        Ok(walked)
    }
}

fn walk(root: &Path, inner: &Path, depth: usize, walked: &mut WalkedFolder) -> std::io::Result<()> {
    for entry in std::fs::read_dir(root.join(inner))? {
        let entry = entry?;
        let path = inner.join(entry.file_name());
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        let kind = match root.join(&path).metadata() {
            Ok(kind) => kind,
            Err(error) => {
                walked.unsearched.push((path, error.to_string()));
                continue;
            }
        };
        if kind.is_file() {
            walked.files.push(path);
        } else if root.join(&path).join(REFINEMENT_FILE).is_file() {
            let reason = "results of tunnelstitch refine, which are no initial poses";
            walked.unsearched.push((path, reason.to_owned()));
        } else if kind.is_dir() && depth > 0 {
            if let Err(error) = walk(root, &path, depth - 1, walked) {
                walked.unsearched.push((path, error.to_string()));
            }
        } else if kind.is_dir() {
            let reason = format!("not searched: more than {MAX_DEPTH} folders below");
            walked.unsearched.push((path, reason));
        }
    }
    Ok(())
}
