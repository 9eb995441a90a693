//! Files of a result, for comparisons of one run with another.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Files by their path within a folder.
pub type Outputs = BTreeMap<PathBuf, Vec<u8>>;

/// All files of a folder and those in it, without what describes a run instead of its result. What
/// writers that were killed have left counts, too.
pub fn outputs(folder: &Path) -> Outputs {
    let files = files(folder).into_iter();
    files
        .map(|(path, bytes)| {
            let result = result(&path, bytes);
            (path, result)
        })
        .collect()
}

/// All files of a folder and those in it, to the byte.
pub fn files(folder: &Path) -> Outputs {
    let mut found = Outputs::new();
    add(folder, folder, &mut found);
    found
}

fn add(folder: &Path, root: &Path, found: &mut Outputs) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            add(&path, root, found);
        } else {
            let bytes = std::fs::read(&path).unwrap();
            found.insert(path.strip_prefix(root).unwrap().to_owned(), bytes);
        }
    }
}

/// The bytes of a file; those of refine.json and run.toml without the parts that describe the run.
fn result(path: &Path, bytes: Vec<u8>) -> Vec<u8> {
    match path.file_name().and_then(|name| name.to_str()) {
        Some("refine.json") => {
            let mut json: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
            let timings = json["timings"].take();
            let stages = timings
                .as_array()
                .unwrap()
                .iter()
                .map(|t| t["stage"].clone());
            json["timings"] = stages.collect();
            json["command"].take();
            json.to_string().into_bytes()
        }
        Some(name) if name.ends_with("run.toml") => {
            let mut run: toml::Table = String::from_utf8(bytes).unwrap().parse().unwrap();
            run.remove("arguments");
            run.remove("options");
            run.to_string().into_bytes()
        }
        _ => bytes,
    }
}
