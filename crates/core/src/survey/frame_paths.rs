//! Paths of a survey's frames for other programs.

use super::open::Survey;
use std::path::{Path, PathBuf};

impl Survey {
    /// Paths of the frames relative to `folder`, with slashes.
    ///
    /// Folders are resolved, since `..` leads elsewhere from a link; a frame that is a link keeps
    /// its name.
    pub fn frame_paths_from(&self, folder: &Path) -> Vec<String> {
        let from = resolved(folder);
        let relative_path = |path: &Path| {
            let file = path.file_name().unwrap_or_default();
            let path = resolved(path.parent().unwrap_or(Path::new(""))).join(file);
            let relative = pathdiff::diff_paths(&path, &from).unwrap_or(path);
            relative
                .to_string_lossy()
                .replace(std::path::MAIN_SEPARATOR, "/")
        };
        self.frames
            .iter()
            .map(|frame| relative_path(&frame.path))
            .collect()
    }
}

/// The absolute path of a folder without links, as far as it exists.
fn resolved(folder: &Path) -> PathBuf {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let full = folder
        .canonicalize()
        .or_else(|_| std::path::absolute(folder));
    full.unwrap_or_else(|_| folder.to_owned())
}
