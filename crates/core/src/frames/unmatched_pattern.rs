//! The content of a folder in which a pattern of frames matches nothing.

use std::collections::BTreeMap;
use std::path::Path;
use tunnelstitch_geometry::files::printed;

/// Most kinds of files that are named.
const MAX_NAMED: usize = 3;

/// A hint, with `; ` in front, for a pattern of files (with slashes, relative to `folder`) that
/// matches none: that there is no such folder, or which files there are instead.
pub(super) fn hint(folder: &Path, pattern: &str) -> String {
    if pattern.starts_with("~/") {
        return "; `~` does not stand for the home folder here: write the whole path".to_owned();
    }
    let (parent, name) = pattern.rsplit_once('/').unwrap_or(("", pattern));
    let whole = folder.join(pattern);
    let (shown, searched) = match whole.is_dir() {
        true => (pattern.trim_end_matches('/'), whole),
        false => (parent, folder.join(parent)),
    };
    if parent.contains(['*', '?', '[']) || name.is_empty() && shown.is_empty() {
        return String::new();
    }
    let Ok(entries) = std::fs::read_dir(&searched) else {
        return format!("; there is no folder {}", printed(&searched));
    };
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    for entry in entries.flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        if !name.as_encoded_bytes().starts_with(b".") && path.is_file() {
            let extension = path.extension().unwrap_or_default().to_string_lossy();
            let kind = match extension.is_empty() {
                true => "*".to_owned(),
                false => format!("*.{extension}"),
            };
            *kinds.entry(kind).or_default() += 1;
        }
    }
    let mut kinds: Vec<(String, usize)> = kinds.into_iter().collect();
    kinds.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let prefix = if shown.is_empty() { "" } else { "/" };
    let named = kinds.iter().take(MAX_NAMED);
    let named: Vec<String> = named
        .map(|(kind, count)| format!("\"{shown}{prefix}{kind}\" ({count})"))
        .collect();
    match named.is_empty() {
        true => format!("; the folder {} holds no files", printed(&searched)),
        false => format!("; there are {}", named.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_instead_is_named() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(dir.path().join("frames/empty")).unwrap();
        for name in [
            "frames/a.JPG",
            "frames/b.JPG",
            "frames/.c.png",
            "frames/n.txt",
            "x.tif",
        ] {
            std::fs::write(dir.path().join(name), "").unwrap();
        }
        for (pattern, expected) in [
            (
                "frames/*.png",
                "; there are \"frames/*.JPG\" (2), \"frames/*.txt\" (1)",
            ),
            (
                "frames",
                "; there are \"frames/*.JPG\" (2), \"frames/*.txt\" (1)",
            ),
            ("*.png", "; there are \"*.tif\" (1)"),
            ("*/*.png", ""),
        ] {
            assert_eq!(hint(dir.path(), pattern), expected, "{pattern}");
        }
        let of = |pattern| hint(dir.path(), pattern);
        assert!(of("pictures/*.png").starts_with("; there is no folder"));
        assert!(of("frames/empty/*.png").ends_with("holds no files"));
    }
}
