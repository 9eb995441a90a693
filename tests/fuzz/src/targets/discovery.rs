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
    let mut found = Discovery::of(folder.path()).unwrap();
    found.find_bits(folder.path());
    found.find_axis(Some(0.5), Some(3.0));
    let _ = (found.frames(), found.truth(), found.survey_toml(None));
}
