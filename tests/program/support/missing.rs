//! Tests that need a program which a machine may lack.

use std::io::Write;
use std::path::{Path, PathBuf};

/// Finds the first of `names` in the folders of `PATH`.
///
/// Without any of them the test is to end early, see [`skip`].
pub fn find_program(names: &[&str]) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let candidates = std::env::split_paths(&folders).flat_map(|folder| {
        let paths = names
            .iter()
            .map(move |name| folder.join(name).with_extension(EXTENSION));
        paths.collect::<Vec<_>>()
    });
    let found = candidates.into_iter().find(|path| path.is_file());
    if found.is_none() {
        skip(names[0]);
    }
    found
}

const EXTENSION: &str = std::env::consts::EXE_EXTENSION;

/// Returns true after a notice if `ffmpeg` or `ffprobe` is missing.
pub fn is_ffmpeg_missing() -> bool {
    ["ffmpeg", "ffprobe"]
        .iter()
        .any(|name| find_program(&[name]).is_none())
}

/// Finds a file that `.ci/run` installs; `name`: what a notice calls it.
pub fn find_installed(path: &Path, name: &str) -> Option<PathBuf> {
    if path.exists() {
        return Some(path.into());
    }
    skip(name);
    None
}

/// Prints that a test is skipped; fails if the environment has `CI`, where nothing may be missing.
///
/// It writes past the test harness, which hides what passing tests print.
pub fn skip(name: &str) {
    assert!(
        std::env::var_os("CI").is_none(),
        "{name} is missing: .ci/run installs it"
    );
    let _ = writeln!(std::io::stderr(), "skipped: {name} is missing");
}
