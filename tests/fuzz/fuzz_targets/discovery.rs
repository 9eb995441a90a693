//! A folder searched by `init`; the first byte selects the name of the file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::survey::Discovery;
use tunnelstitch_fuzz::file;

const NAMES: [&str; 6] = ["a.json", "a.toml", "a.yaml", "a.txt", "a.csv", "a.png"];

fuzz_target!(|data: &[u8]| {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let (folder, _path) = file(NAMES[usize::from(*first) % NAMES.len()], content);
    let found = Discovery::of(folder.path()).unwrap();
    let _ = (found.frames(), found.initial(), found.truth());
});
