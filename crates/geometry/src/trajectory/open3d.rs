//! JSON of Open3D: a `PoseGraph` (camera-to-world) or a `PinholeCameraTrajectory`
//! (world-to-camera). Matrices are written column by column.

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::rigid;
use serde::Deserialize;
use std::path::Path;

/// Numbers of a row of a matrix.
const COLUMNS: usize = 4;
/// Numbers of a matrix.
const NUMBERS: usize = COLUMNS * COLUMNS;

/// The two documents that hold poses.
#[derive(Deserialize)]
#[serde(tag = "class_name")]
enum Document {
    PoseGraph { nodes: Vec<Node> },
    PinholeCameraTrajectory { parameters: Vec<Camera> },
}

#[derive(Deserialize)]
struct Node {
    pose: [f64; NUMBERS],
}

#[derive(Deserialize)]
struct Camera {
    extrinsic: [f64; NUMBERS],
}

/// Camera-to-world poses of a document of Open3D, in its order; None for any other text.
///
/// # Errors
/// A matrix that is no rigid motion.
pub(super) fn parse(path: &Path, text: &str) -> Result<Option<Vec<PoseEntry>>, PoseError> {
    if !text.trim_start().starts_with('{') {
        return Ok(None);
    }
    let poses: Vec<Result<Pose, String>> = match serde_json::from_str(text) {
        Ok(Document::PoseGraph { nodes }) => nodes.iter().map(|node| motion(&node.pose)).collect(),
        Ok(Document::PinholeCameraTrajectory { parameters }) => parameters
            .iter()
            .map(|camera| Ok(motion(&camera.extrinsic)?.inverse()))
            .collect(),
        Err(_) => return Ok(None),
    };
    let entry = |(k, pose): (usize, Result<Pose, String>)| {
        let fail = |what| PoseError::file(path, format!("pose {}: {what}", k + 1));
        Ok(PoseEntry {
            camera: None,
            name: None,
            time_s: None,
            pose: pose.map_err(fail)?,
        })
    };
    let entries: Result<_, _> = poses.into_iter().enumerate().map(entry).collect();
    entries.map(Some)
}

/// The motion of a matrix that is written column by column.
fn motion(columns: &[f64; NUMBERS]) -> Result<Pose, String> {
    let row = |k: usize| [0, 1, 2, 3].map(|column| columns[COLUMNS * column + k]);
    rigid::from_rows(&[0, 1, 2, 3].map(row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A quarter turn about z, which carries x to y, and a position.
    const MATRIX: &str = "[0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]";

    fn parsed(text: &str) -> Result<Option<Vec<Pose>>, PoseError> {
        let entries = parse(Path::new("poses.json"), text)?;
        Ok(entries.map(|entries| entries.iter().map(|entry| entry.pose).collect()))
    }

    #[test]
    fn graphs_are_camera_to_world_and_trajectories_the_inverse() {
        let graph = format!(
            r#"{{"class_name": "PoseGraph", "edges": [], "version_major": 1,
                "nodes": [{{"class_name": "PoseGraphNode", "pose": {MATRIX}}}]}}"#
        );
        let [pose] = parsed(&graph).unwrap().unwrap()[..] else {
            panic!("one pose");
        };
        assert_eq!(pose.t_wc, Vector3::new(5.0, 6.0, 7.0));
        assert!((pose.r_wc * Vector3::x() - Vector3::y()).norm() < 1e-12);
        let trajectory = format!(
            r#"{{"class_name": "PinholeCameraTrajectory", "version_minor": 0,
                "parameters": [{{"extrinsic": {MATRIX}, "intrinsic": {{"width": 640}}}}]}}"#
        );
        let [inverse] = parsed(&trajectory).unwrap().unwrap()[..] else {
            panic!("one pose");
        };
        let identity = pose.after(&inverse);
        assert!(identity.t_wc.norm() < 1e-12 && identity.r_wc.angle() < 1e-12);
    }

    #[test]
    fn what_is_no_motion_is_refused_and_other_texts_are_left() {
        let scaled = r#"{"class_name": "PoseGraph", "nodes": [
            {"pose": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]}]}"#;
        let error = parsed(scaled).unwrap_err().to_string();
        assert!(error.contains("poses.json: pose 1: "), "{error}");
        for other in ["{\"frames\": []}", "{", "0 0 0 0 0 0 0 1", "[]"] {
            assert!(parsed(other).unwrap().is_none(), "{other}");
        }
    }
}
