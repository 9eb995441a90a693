//! Files of poses of every format.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.txt");
    std::fs::write(&path, data).unwrap();
    if let Ok(file) = tunnelstitch::trajectory::read_poses(&path, None) {
        let finite = |pose: &tunnelstitch::trajectory::Pose| pose.t_wc.iter().all(|v| v.is_finite());
        assert!(file.entries.iter().all(|entry| finite(&entry.pose)));
    }
});
