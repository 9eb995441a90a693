//! What the targets share: files of what the fuzzer thinks up, and a small survey to read them with.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;
use tunnelstitch::camera::Camera;
use tunnelstitch::progress::Silent;
use tunnelstitch::simulate::{self, SimulateOptions};

/// A file in a folder of its own, which goes with the latter.
pub fn file(name: &str, content: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

/// Frames of the small survey.
pub const FRAMES: usize = 4;

/// The folder of a survey of [`FRAMES`] frames of 32 × 24 pixels, simulated once.
pub fn small_survey() -> &'static Path {
    static SURVEY: OnceLock<TempDir> = OnceLock::new();
    let folder = SURVEY.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let options = SimulateOptions {
            frames: FRAMES,
            camera: Camera::from_vertical_fov(32, 24, 1.0),
            supersample: 1,
            ..SimulateOptions::free()
        };
        simulate::run(&options, folder.path(), true, &Silent).unwrap();
        folder
    });
    folder.path()
}
