//! Meshroom's `cameras.sfm`, AliceVision's SfMData in JSON: `views` with the paths of the pictures,
//! `poses` with the `rotation` of a camera, nine numbers column by column, **world-to-camera** in
//! OpenCV's axes, and its `center` in the world.
//!
//! Numbers are written as texts. Views of a rig have the pose of the rig and are refused. Source:
//! AliceVision (SfMData 1.2.11), `jsonIO.hpp`, `Pose3.hpp`.

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::{json_form, rigid, text};
use crate::files::json::number;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;

#[derive(Deserialize)]
struct SfmData {
    #[serde(default)]
    views: Vec<View>,
    #[serde(default)]
    poses: Vec<PoseOfId>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    path: String,
    pose_id: Option<Value>,
    rig_id: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PoseOfId {
    pose_id: Value,
    pose: Placed,
}

#[derive(Deserialize)]
struct Placed {
    transform: Transform,
}

#[derive(Deserialize)]
struct Transform {
    rotation: [Value; 9],
    center: [Value; 3],
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let fail = |what: String| PoseError::file(path, what);
    let data: SfmData =
        serde_json::from_str(text).map_err(|error| fail(json_form::mismatch(text, &error)))?;
    let poses = data.poses.iter();
    let poses: HashMap<String, &Transform> = poses
        .map(|pose| (pose.pose_id.to_string(), &pose.pose.transform))
        .collect();
    let mut names = text::Names::default();
    let mut entries = Vec::new();
    for view in data.views {
        let of_view = |what: String| fail(format!("view {}: {what}", view.path));
        if view.rig_id.is_some() {
            return Err(of_view(
                "it is one of a rig, whose poses are not read; leave the rig out in Meshroom"
                    .to_owned(),
            ));
        }
        let id = view.pose_id.as_ref().map(Value::to_string);
        let Some(transform) = id.and_then(|id| poses.get(&id).copied()) else {
            continue;
        };
        names.add(&view.path).map_err(of_view)?;
        let pose = transform.world_to_camera().map_err(of_view)?;
        entries.push(PoseEntry::named(view.path, pose));
    }
    Ok(entries)
}

impl Transform {
    /// The motion `x_c = R (x_w − c)`.
    fn world_to_camera(&self) -> Result<Pose, String> {
        // Column by column, the rotation to the camera is row by row that to the world.
        let [a, b, c, d, e, f, g, h, i] = numbers(&self.rotation, "rotation")?;
        let [x, y, z] = numbers(&self.center, "center")?;
        let to_world = rigid::from_rows(&[[a, b, c, x], [d, e, f, y], [g, h, i, z]])?;
        Ok(to_world.inverse())
    }
}

/// The numbers of a list, which may be texts.
fn numbers<const N: usize>(list: &[Value; N], name: &str) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for (place, value) in numbers.iter_mut().zip(list) {
        *place =
            number(value).ok_or_else(|| format!("{name} holds {value}, which is no number"))?;
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use crate::trajectory::format_tests::read_named;
    use crate::trajectory::{Convention, PoseFile, PoseFormat};
    use nalgebra::Vector3;

    fn read(text: &str) -> Result<PoseFile, String> {
        read_named("cameras.sfm", text)
    }

    /// The rows of R, world-to-camera, are x, y and z of the camera in the world: x towards −y, y
    /// towards −z, z along x. The file has its columns.
    const ROTATION: &str = r#"["0", "0", "1", "-1", "0", "0", "0", "-1", "0"]"#;

    fn file(view: &str, rotation: &str) -> String {
        format!(
            r#"{{"version": ["1", "2", "6"], "featuresFolders": [""], "views": [
                {{"viewId": "11", "poseId": "12", "intrinsicId": "13", "path": "/x/b.jpg",
                "width": "640", "height": "480", "metadata": {{"Make": "Maker"}} {view}}},
                {{"viewId": "21", "poseId": "22", "path": "/x/none.jpg"}}],
                "intrinsics": [], "poses": [{{"poseId": "12", "pose": {{"transform": {{
                "rotation": {rotation}, "center": ["1", "2", "3"]}}, "locked": "0"}}}}]}}"#
        )
    }

    #[test]
    fn rotations_are_given_column_by_column() {
        for rotation in [ROTATION.to_owned(), ROTATION.replace('"', "")] {
            let file = read(&file("", &rotation)).unwrap();
            assert_eq!((file.format, file.entries.len()), (PoseFormat::Meshroom, 1));
            assert_eq!(file.entries[0].name.as_deref(), Some("/x/b.jpg"));
            let pose = Convention::of(file.format).to_world(&file.entries[0].pose);
            assert!((pose.t_wc - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
            // 4 m along the world's x is ahead, 0.5 m along −z below, 2 m along −y to the right.
            let seen = pose.to_camera(&Vector3::new(5.0, 0.0, 2.5));
            assert!(
                (seen - Vector3::new(2.0, 0.5, 4.0)).norm() < 1e-12,
                "{seen}"
            );
        }
    }

    #[test]
    fn broken_files_name_the_view() {
        for (text, expected) in [
            (
                file("", &ROTATION.replacen("\"0\"", "\"x\"", 1)),
                "view /x/b.jpg: rotation holds \"x\"",
            ),
            (
                file("", &ROTATION.replacen("\"0\"", "\"1\"", 1)),
                "view /x/b.jpg: its first three columns",
            ),
            (file("", r#"["1"]"#), "invalid length 1"),
            (file(r#", "rigId": "1""#, ROTATION), "one of a rig"),
            (
                file("", ROTATION).replace("\"12\", \"int", "\"9\", \"int"),
                "holds no poses",
            ),
        ] {
            let message = read(&text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
