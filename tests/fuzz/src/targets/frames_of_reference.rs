//! Camera mounts and tunnel frames.

use super::super::file;
use tunnelstitch::trajectory::{read_camera_in_body, read_tunnel_frame};

/// Reads the input.
pub fn run(data: &[u8]) {
    let (_folder, path) = file("frame.yaml", data);
    for pose in [read_camera_in_body(&path), read_tunnel_frame(&path)]
        .into_iter()
        .flatten()
    {
        assert!(pose.t_wc.iter().all(|v| v.is_finite()));
    }
}
