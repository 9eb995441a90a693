//! A folder searched by `init`; the first byte selects the name of the file.

use super::super::file;
use tunnelstitch::survey::Discovery;

const NAMES: [&str; 11] = [
    "a.json",
    "a.toml",
    "a.yaml",
    "a.txt",
    "a.csv",
    "a.png",
    "cameras.bin",
    "images.bin",
    "a.xml",
    "a.sfm",
    "a.out",
];

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let (folder, _path) = file(NAMES[usize::from(*first) % NAMES.len()], content);
    let found = Discovery::of(folder.path()).unwrap();
    let _ = (found.frames(), found.initial(), found.truth());
}
