//! nerfstudio's `transforms.json`: `frames`, each with `file_path` and a camera-to-world
//! `transform_matrix` in OpenGL's axes (y up, z backwards).
//!
//! `applied_transform`, which was applied to the poses afterwards, is inverted.

use super::axes::CameraAxes;
use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::stamped_pose::StampedPose;
use super::{json_form, rigid, text};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::path::Path;

#[derive(Deserialize)]
struct Transforms {
    frames: Vec<Frame>,
    applied_transform: Option<Vec<[f64; 4]>>,
    applied_scale: Option<f64>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Vec<[f64; 4]>,
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let fail = |what: String| PoseError::file(path, what);
    let transforms: Transforms =
        serde_json::from_str(text).map_err(|error| fail(json_form::mismatch(text, &error)))?;
    if let Some(scale) = transforms.applied_scale
        && scale != 1.0
    {
        return Err(fail(format!(
            "applied_scale is {scale}: the positions are no metres; export the poses unscaled"
        )));
    }
    let applied = match &transforms.applied_transform {
        Some(rows) => rigid::from_rows(rows)
            .map_err(|what| fail(format!("applied_transform: {what}")))?
            .inverse(),
        None => Pose::identity(),
    };
    let mut names = text::Names::default();
    let mut entries = Vec::new();
    for (index, frame) in transforms.frames.into_iter().enumerate() {
        let of_frame =
            |what: String| fail(format!("frames[{index}] ({}): {what}", frame.file_path));
        names.add(&frame.file_path).map_err(of_frame)?;
        let pose = rigid::from_rows(&frame.transform_matrix)
            .map_err(|what| of_frame(format!("transform_matrix: {what}")))?;
        entries.push(PoseEntry::named(frame.file_path, applied.after(&pose)));
    }
    Ok(entries)
}

/// Formats a `transforms.json`. `camera` holds the keys of the camera, `names` the frames' paths
/// from the file's folder; `trajectory` is camera-to-world in OpenCV's axes.
pub fn format(camera: Map<String, Value>, names: &[String], trajectory: &[StampedPose]) -> String {
    let frames: Vec<Value> = names
        .iter()
        .zip(trajectory)
        .map(|(name, stamped)| {
            let [a, b, c] = rigid::to_rows(&CameraAxes::OpenGl.turn(&stamped.pose));
            json!({ "file_path": name, "transform_matrix": [a, b, c, [0.0, 0.0, 0.0, 1.0]] })
        })
        .collect();
    let mut file = camera;
    file.insert("frames".to_owned(), Value::Array(frames));
    // Numbers and names always serialise.
    serde_json::to_string_pretty(&Value::Object(file)).unwrap_or_default() + "\n"
}
