//! survey.toml.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("survey.toml"), data).unwrap();
    let _ = tunnelstitch::survey::Survey::open(folder.path());
});
