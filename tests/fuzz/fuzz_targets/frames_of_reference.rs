//! Mounts of cameras and frames of tunnels.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::trajectory::{read_camera_in_body, read_tunnel_frame};

fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.yaml");
    std::fs::write(&path, data).unwrap();
    let _ = read_camera_in_body(&path);
    let _ = read_tunnel_frame(&path);
});
