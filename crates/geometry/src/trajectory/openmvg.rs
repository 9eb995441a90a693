//! OpenMVG's `sfm_data.json`: `views` with the names of the pictures and `extrinsics` with the
//! `rotation` of a camera, row by row, **world-to-camera** in OpenCV's axes, and its `center` in
//! the world.
//!
//! Source: OpenMVG 2.1 (sfm_data_version 0.3), `sfm_data_io_cereal.cpp`, `pose3_io.hpp`.

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::{json_form, rigid, text};
use serde::Deserialize;
use std::collections::HashMap;
use std::path::Path;

#[derive(Deserialize)]
struct SfmData {
    views: Vec<Keyed<Wrapped>>,
    extrinsics: Vec<Keyed<Placed>>,
}

#[derive(Deserialize)]
struct Keyed<T> {
    key: u64,
    value: T,
}

#[derive(Deserialize)]
struct Wrapped {
    ptr_wrapper: Data,
}

#[derive(Deserialize)]
struct Data {
    data: View,
}

#[derive(Deserialize)]
struct View {
    #[serde(default)]
    local_path: String,
    filename: String,
    id_pose: u64,
}

#[derive(Deserialize)]
struct Placed {
    rotation: [[f64; 3]; 3],
    center: [f64; 3],
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let fail = |what: String| PoseError::file(path, what);
    let data: SfmData =
        serde_json::from_str(text).map_err(|error| fail(json_form::mismatch(text, &error)))?;
    let poses: HashMap<u64, Placed> = data
        .extrinsics
        .into_iter()
        .map(|pose| (pose.key, pose.value))
        .collect();
    let mut names = text::Names::default();
    let mut entries = Vec::new();
    for view in data.views {
        let view = view.value.ptr_wrapper.data;
        let Some(placed) = poses.get(&view.id_pose) else {
            continue;
        };
        let name = Path::new(&view.local_path).join(&view.filename);
        let name = name.to_string_lossy().into_owned();
        let of_view = |what: String| fail(format!("view {name}: {what}"));
        names.add(&name).map_err(of_view)?;
        let pose = placed.world_to_camera().map_err(of_view)?;
        entries.push(PoseEntry::named(name, pose));
    }
    Ok(entries)
}

impl Placed {
    /// The motion `x_c = R (x_w − c)`.
    fn world_to_camera(&self) -> Result<Pose, String> {
        let rows = self.rotation.map(|[a, b, c]| [a, b, c, 0.0]);
        let turn = rigid::from_rows(&rows)?;
        let centre = nalgebra::Vector3::from(self.center);
        Ok(Pose::new(turn.r_wc, -(turn.r_wc * centre)))
    }
}

#[cfg(test)]
mod tests {
    use crate::trajectory::format_tests::read_named;
    use crate::trajectory::{Convention, PoseFile, PoseFormat};
    use nalgebra::Vector3;

    fn read(text: &str) -> Result<PoseFile, String> {
        read_named("sfm_data.json", text)
    }

    /// A file with a view that has a pose and one that has none (the largest number for none).
    fn file(rotation: &str) -> String {
        let view = |key: u32, name: &str, pose: u32| {
            format!(
                r#"{{"key": {key}, "value": {{"polymorphic_id": 1073741824, "ptr_wrapper":
                    {{"id": 2147483649, "data": {{"local_path": "left/", "filename": "{name}",
                    "width": 640, "height": 480, "id_view": {key}, "id_intrinsic": 0,
                    "id_pose": {pose}}}}}}}}}"#
            )
        };
        format!(
            r#"{{"sfm_data_version": "0.3", "root_path": "/x", "views": [{}, {}],
                "intrinsics": [], "extrinsics": [{{"key": 5, "value": {{"rotation": {rotation},
                "center": [1, 2, 3]}}}}], "structure": [], "control_points": []}}"#,
            view(0, "b.jpg", 5),
            view(1, "none.jpg", u32::MAX)
        )
    }

    /// x of the camera towards the world's −y, y towards −z, z along x.
    const ROTATION: &str = "[[0, -1, 0], [0, 0, -1], [1, 0, 0]]";

    #[test]
    fn rotations_are_given_row_by_row() {
        let file = read(&file(ROTATION)).unwrap();
        assert_eq!((file.format, file.entries.len()), (PoseFormat::Openmvg, 1));
        assert_eq!(file.entries[0].name.as_deref(), Some("left/b.jpg"));
        let pose = Convention::of(file.format).to_world(&file.entries[0].pose);
        assert!((pose.t_wc - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
        let seen = pose.to_camera(&Vector3::new(5.0, 0.0, 2.5));
        assert!(
            (seen - Vector3::new(2.0, 0.5, 4.0)).norm() < 1e-12,
            "{seen}"
        );
    }

    #[test]
    fn broken_files_name_the_view() {
        for (text, expected) in [
            (
                file(&ROTATION.replace("[1,", "[2,")),
                "view left/b.jpg: its first three columns",
            ),
            (
                file(ROTATION).replace("\"key\": 5", "\"key\": 6"),
                "holds no poses",
            ),
            (
                file(ROTATION)
                    .replace("none.jpg", "b.jpg")
                    .replace("4294967295", "5"),
                "a second pose",
            ),
            (file("[[1, 0]]"), "invalid length 2"),
            (r#"{"extrinsics": []}"#.to_owned(), "missing field `views`"),
        ] {
            let message = read(&text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
