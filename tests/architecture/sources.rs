//! The source files of the project.

use crate::Offence;
use std::path::{Path, PathBuf};

/// Judges every Rust file of the project.
pub fn in_all_files(rule: impl Fn(&Path, &str) -> Vec<Offence>) -> Vec<Offence> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = vec![PathBuf::from("build.rs")];
    for folder in ["src", "crates", "tests", "benches", "examples"] {
        collect_rust_files(root, Path::new(folder), &mut paths);
    }
    paths.sort();
    let read = |path: &Path| std::fs::read_to_string(root.join(path)).expect("a source file");
    paths
        .iter()
        .flat_map(|path| rule(path, &read(path)))
        .collect()
}

/// Adds the Rust files below a folder to `paths`, as seen from the project's folder.
pub fn collect_rust_files(root: &Path, folder: &Path, paths: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(root.join(folder)) else {
        return;
    };
    for entry in entries {
        let entry = entry.expect("an entry of a folder");
        let path = folder.join(entry.file_name());
        if entry.path().is_dir() {
            collect_rust_files(root, &path, paths);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            paths.push(path);
        }
    }
}
