//! Helpers of the targets: files with the fuzzer's content, and a small survey to read them with.

pub mod targets;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;
use tunnelstitch::camera::Camera;
use tunnelstitch::progress::Silent;
use tunnelstitch::simulate::{self, SimulateOptions};

/// A file in a temporary folder of its own.
pub fn file(name: &str, content: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

/// Frames of the small survey.
pub const FRAMES: usize = 4;

/// Files of the small survey that its survey.toml may name, in addition to those of the simulator.
const OTHERS: [(&str, &str); 4] = [
    ("times.txt", "0\n1\n2\n3\n"),
    ("curve.txt", "0 -50 0\n0 0 0 3.1\n1 50 0\n"),
    ("axis.json", r#"{"point_m": [0, 0, 0], "axis": [0, 1, 0]}"#),
    (
        "body.yaml",
        "T_BS: {rows: 4, cols: 4, data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\n",
    ),
];

/// The folder of a survey of [`FRAMES`] frames of 32 × 24 pixels with a mask, simulated once.
pub fn small_survey() -> &'static Path {
    static SURVEY: OnceLock<TempDir> = OnceLock::new();
    let folder = SURVEY.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let options = SimulateOptions {
            frames: FRAMES,
            camera: Camera::from_vertical_fov(32, 24, 1.0),
            supersample: 1,
            shaft_percent: 12.0,
            ..SimulateOptions::free()
        };
        simulate::write_survey(&options, folder.path(), true, &Silent).unwrap();
        for (name, content) in OTHERS {
            std::fs::write(folder.path().join(name), content).unwrap();
        }
        folder
    });
    folder.path()
}
