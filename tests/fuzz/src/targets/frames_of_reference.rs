//! Camera mounts, alone and in rigs of COLMAP, and tunnel frames.

use super::super::file;
use tunnelstitch::trajectory::{cameras_of_rigs, read_camera_in_body, read_tunnel_frame};

/// Reads the input.
pub fn run(data: &[u8]) {
    let (_folder, path) = file("frame.yaml", data);
    let mut poses = vec![
        read_camera_in_body(&path, Some("cam0")),
        read_tunnel_frame(&path),
    ];
    for name in ["rigs.txt", "rigs.bin"] {
        let (_folder, path) = file(name, data);
        let _ = cameras_of_rigs(&path);
        poses.push(read_camera_in_body(&path, Some("2")));
    }
    for pose in poses.into_iter().flatten() {
        assert!(pose.t_wc.iter().all(|v| v.is_finite()));
    }
}
