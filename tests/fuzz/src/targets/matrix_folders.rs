//! Folders with a matrix in each of their files, which are separated by zero bytes.

use tunnelstitch::survey::Discovery;
use tunnelstitch::trajectory::read_poses;

/// Largest number of files.
const MAX_FILES: usize = 16;

/// Reads the input.
pub fn run(data: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let poses = folder.path().join("pose");
    std::fs::create_dir(&poses).unwrap();
    for (k, content) in data.split(|byte| *byte == 0).take(MAX_FILES).enumerate() {
        std::fs::write(poses.join(format!("{k}.txt")), content).unwrap();
    }
    if let Ok(read) = read_poses(&poses, None) {
        let mut entries = read.entries.iter();
        assert!(entries.all(|entry| entry.pose.t_wc.iter().all(|v| v.is_finite())));
    }
    let found = Discovery::of(folder.path()).unwrap();
    let _ = (found.frames(), found.survey_toml(Some(3.0)));
}
