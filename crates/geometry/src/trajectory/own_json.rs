//! JSON and YAML of people's own: a list of poses, or one pose under each frame's name.
//!
//! A pose is a 4 × 4 or 3 × 4 matrix, row by row, or an object with a matrix, or with a position
//! and a quaternion or a rotation matrix. Names of keys are compared without capitals and signs
//! between words ([`keys`]). The list is the file, or the only entry of its object
//! that holds poses. Poses are camera-to-world with OpenCV's axes unless a key says otherwise.

use super::entry_list::{EntryList, ParsedPoses};
use super::error::PoseError;
use super::own_keys::{self as keys, Keyed};
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::pose_options::PoseFileOptions;
use super::quaternion_order::QuaternionOrder;
use super::{rigid, text, times};
use nalgebra::Vector3;
use serde_json::Value;
use std::path::Path;

/// Deepest nesting of a pose within an entry.
const MAX_DEPTH: usize = 3;
/// Smallest number of entries that are poses by their frames' names: a single matrix is a mount.
const MIN_NAMED_POSES: usize = 2;

/// True for JSON or YAML whose values are poses in a form known here.
pub(super) fn has_poses(path: &Path, text: &str) -> bool {
    tree_of(path, text).is_some_and(|tree| entries_of(&tree).is_some())
}

/// Parses the poses of a file.
///
/// # Errors
/// A text without poses, an entry that is none, a matrix or a quaternion of no rotation, two poses
/// of a name, times that do not increase.
pub(super) fn parse(
    path: &Path,
    text: &str,
    options: &PoseFileOptions,
) -> Result<ParsedPoses, PoseError> {
    let tree = tree_of(path, text);
    let entries = tree.as_ref().and_then(entries_of);
    let entries = entries.ok_or_else(|| PoseError::no_poses(path))?;
    let mut names = text::Names::default();
    let mut list = EntryList::new(options.duplicate_times);
    for (k, (name, value)) in entries.into_iter().enumerate() {
        let fail = |what: String| PoseError::file(path, format!("pose {}: {what}", k + 1));
        let pose = pose_of(value, options, 0)
            .ok_or_else(|| fail("has neither a matrix nor a position with a rotation".to_owned()))?
            .map_err(fail)?;
        let name = name.or_else(|| keys::text(value, keys::NAMES));
        if let Some(name) = &name {
            names.add(name).map_err(fail)?;
        }
        let time = keys::word(value, keys::TIMES);
        let time_s = time.and_then(|word| times::from_word(&word, options.time_unit));
        let entry = PoseEntry {
            name,
            camera: None,
            time_s,
            pose,
        };
        list.push(k + 1, entry).map_err(fail)?;
    }
    Ok(list.into_parsed())
}

/// The values of a text that is JSON, or YAML by its name.
fn tree_of(path: &Path, text: &str) -> Option<Value> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let is_yaml = ["yaml", "yml"].contains(&&*extension.to_lowercase());
    let is_json = text.trim_start().starts_with(['{', '[']);
    if is_json {
        serde_json::from_str(text).ok()
    } else {
        is_yaml.then(|| serde_saphyr::from_str(text).ok()).flatten()
    }
}

/// The entries that hold poses, with their names if these are keys, in the order of their numbers
/// if all have one: the file's own, or those of its only part that has some.
fn entries_of(tree: &Value) -> Option<Vec<(Option<String>, &Value)>> {
    let mut entries = poses_in(tree).or_else(|| {
        let mut parts = tree.as_object()?.values().filter_map(poses_in);
        let first = parts.next();
        first.filter(|_| parts.next().is_none())
    })?;
    let number = |value: &Value| keys::number(value, keys::COUNTERS);
    if entries.iter().all(|(_, value)| number(value).is_some()) {
        entries.sort_by(|(_, a), (_, b)| {
            let [a, b] = [a, b].map(|value| number(value).unwrap_or_default());
            a.total_cmp(&b)
        });
    }
    Some(entries)
}

/// The entries of a list whose first is a pose, or of an object all of which are.
fn poses_in(value: &Value) -> Option<Vec<(Option<String>, &Value)>> {
    let options = PoseFileOptions::default();
    let is_pose = |value: &Value| pose_of(value, &options, 0).is_some();
    match value {
        Value::Array(list) => {
            let entries = list.iter().map(|value| (None, value));
            list.first().is_some_and(is_pose).then(|| entries.collect())
        }
        Value::Object(map) => {
            let is_file = map.len() >= MIN_NAMED_POSES && map.values().all(is_pose);
            let mut entries: Vec<_> = map.iter().collect();
            entries.sort_by(|(a, _), (b, _)| alphanumeric_sort::compare_str(a, b));
            let named = entries.into_iter();
            let named = named.map(|(name, value)| (Some(name.clone()), value));
            is_file.then(|| named.collect())
        }
        _ => None,
    }
}

/// The pose of an entry; None if it has none.
fn pose_of(value: &Value, options: &PoseFileOptions, depth: usize) -> Option<Result<Pose, String>> {
    if let Some(matrix) = matrix_of(value) {
        return Some(matrix);
    }
    let inverse = |matrix: Result<Pose, String>| matrix.map(|pose| pose.inverse());
    keys::find(value, keys::MATRICES)
        .and_then(|found| matrix_of(found.value))
        .or_else(|| matrix_of(keys::find(value, keys::INVERSE_MATRICES)?.value).map(inverse))
        .or_else(|| position_and_rotation(value, options))
        .or_else(|| {
            let inner = keys::find(value, keys::MATRICES).filter(|_| depth < MAX_DEPTH)?;
            pose_of(inner.value, options, depth + 1)
        })
}

/// The motion of a matrix that is written row by row, in rows or in one list; None for other lists.
fn matrix_of(value: &Value) -> Option<Result<Pose, String>> {
    let numbers = keys::numbers(value)?;
    let is_matrix = matches!(numbers.len(), 12 | 16);
    let rows: Vec<[f64; 4]> = numbers.as_chunks().0.to_vec();
    is_matrix.then(|| rigid::from_rows(&rows))
}

/// The pose of an object with a position and a rotation, or with their components.
fn position_and_rotation(value: &Value, options: &PoseFileOptions) -> Option<Result<Pose, String>> {
    let given = keys::find(value, keys::POSITIONS);
    let position = match given {
        Some(given) => keys::numbers_or_components(given.value, keys::XYZ)?,
        None => keys::components(value, keys::XYZ)?,
    };
    let [x, y, z] = position[..] else {
        return None;
    };
    let rotation = match keys::find(value, keys::ROTATIONS) {
        Some(given) => rotation_of(&given, options)?,
        None => quaternion(keys::components(value, keys::INLINE_WXYZ)?, None)?,
    };
    Some(rotation.map(|pose| Pose::new(pose.r_wc, Vector3::new(x, y, z))))
}

/// The rotation of a quaternion, by components or in the order that its key or the options name,
/// or of a matrix row by row.
fn rotation_of(given: &Keyed, options: &PoseFileOptions) -> Option<Result<Pose, String>> {
    if let Some(wxyz) = keys::components(given.value, keys::WXYZ) {
        return quaternion(wxyz, None);
    }
    let numbers = keys::numbers(given.value)?;
    match numbers[..] {
        [a, b, c, d, e, f, g, h, i] => {
            let rows = [[a, b, c, 0.0], [d, e, f, 0.0], [g, h, i, 0.0]];
            Some(rigid::from_rows(&rows))
        }
        _ => {
            let named = match given.key.as_str() {
                key if key.ends_with("wxyz") => Some(QuaternionOrder::Wxyz),
                key if key.ends_with("xyzw") => Some(QuaternionOrder::Xyzw),
                _ => options.quaternion,
            };
            quaternion(numbers, Some(named.unwrap_or_default()))
        }
    }
}

/// The rotation of four numbers in an order, or as w, x, y, z.
fn quaternion(numbers: Vec<f64>, order: Option<QuaternionOrder>) -> Option<Result<Pose, String>> {
    let four: [f64; 4] = numbers.try_into().ok()?;
    let order = order.unwrap_or(QuaternionOrder::Wxyz);
    let rotation = text::rotation(order.wxyz(four), order.columns());
    Some(rotation.map(|r_wc| Pose::new(r_wc, Vector3::zeros())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{PoseFormat, read_poses, spiral};
    use serde_json::json;

    fn read(value: &Value) -> Result<Vec<PoseEntry>, PoseError> {
        let text = value.to_string();
        let path = Path::new("poses.json");
        assert!(has_poses(path, &text), "{text}");
        parse(path, &text, &PoseFileOptions::default()).map(|parsed| parsed.entries)
    }

    /// Two poses in the forms that people write.
    #[test]
    fn every_usual_form_has_the_same_poses() {
        let poses = spiral(2, 0.3, 0.4);
        let rows = |pose: &Pose| {
            let [a, b, c] = rigid::to_rows(pose);
            json!([a, b, c, [0.0, 0.0, 0.0, 1.0]])
        };
        let t = |pose: &Pose| pose.t_wc.as_slice().to_vec();
        let q = |pose: &Pose| pose.r_wc.coords.as_slice().to_vec();
        let wxyz = |pose: &Pose| [vec![q(pose)[3]], q(pose)[..3].to_vec()].concat();
        let r = |pose: &Pose| rigid::to_rows(pose).map(|row| [row[0], row[1], row[2]]);
        let forms: [&dyn Fn(&Pose) -> Value; 9] = [
            &rows,
            &|pose| json!({ "name": "a", "T_wc": rows(pose) }),
            &|pose| json!({ "world-to-camera": rows(&pose.inverse()) }),
            &|pose| json!({ "pose": { "position": t(pose), "orientation": q(pose) } }),
            &|pose| json!({ "translation": t(pose), "quaternion_wxyz": wxyz(pose) }),
            &|pose| json!({ "R": r(pose), "t": t(pose) }),
            &|pose| {
                let (t, q) = (t(pose), q(pose));
                json!({ "position": { "x": t[0], "y": t[1], "z": t[2] },
                    "rotation": { "w": q[3], "x": q[0], "y": q[1], "z": q[2] } })
            },
            &|pose| {
                let (t, q) = (t(pose), q(pose));
                json!({ "x": t[0], "y": t[1], "z": t[2],
                    "qx": q[0], "qy": q[1], "qz": q[2], "qw": q[3] })
            },
            &|pose| {
                json!({ "matrix": rows(pose).as_array().unwrap().iter()
                .flat_map(|row| row.as_array().unwrap().clone()).collect::<Vec<_>>() })
            },
        ];
        for form in forms {
            let [a, b] = [0, 1].map(|k| form(&poses[k]));
            let unnamed = |mut value: Value| {
                value.as_object_mut().map(|map| map.remove("name"));
                value
            };
            let [a, b] = [a, b].map(unnamed);
            for file in [
                json!([a, b]),
                json!({ "unit": "m", "poses": [a, b] }),
                json!({ "10.png": b, "9.png": a }),
            ] {
                let read = read(&file).unwrap();
                for (entry, pose) in read.iter().zip(&poses) {
                    assert!(entry.pose.local(pose).norm() < 1e-12, "{file}");
                }
                let names = read.iter().map(|entry| entry.name.as_deref());
                let expected = file.get("9.png").map(|_| ["9.png", "10.png"]);
                assert!(names.flatten().eq(expected.into_iter().flatten()), "{file}");
            }
        }
    }

    /// Brackets of matrices are no signs between the numbers of other texts.
    #[test]
    fn a_file_of_matrices_is_detected() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.json");
        let rows = "[[1, 0, 0, 0], [0, 1, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]]";
        std::fs::write(&path, format!("[{rows}, {rows}]")).unwrap();
        let file = read_poses(&path, None).unwrap();
        assert_eq!((file.format, file.entries.len()), (PoseFormat::Json, 2));
        assert_eq!(file.entries[1].pose.t_wc.y, 0.5);
    }

    #[test]
    fn names_times_and_numbers_are_found() {
        let entry = |index: u32, name: &str, y: f64| {
            json!({ "id": index, "imageName": name, "timestamp": 1_764_060_458_000_000_000_u64
                + 1_000_000 * u64::from(index), "position": [0, y, 0], "quaternion": [0, 0, 0, 1] })
        };
        let read = read(&json!([entry(2, "b.png", 0.2), entry(1, "a.png", 0.1)])).unwrap();
        assert_eq!(read[0].name.as_deref(), Some("a.png"));
        assert_eq!((read[0].pose.t_wc.y, read[1].pose.t_wc.y), (0.1, 0.2));
        assert!(
            read.iter()
                .all(|entry| entry.time_s.unwrap().round() == 1_764_060_458.0)
        );
    }

    #[test]
    fn yaml_is_read_by_its_name_and_what_is_no_pose_is_left() {
        let yaml = "- frame: 0.png\n  position: [0, 1, 0]\n  quaternion: [0, 0, 0, 1]\n";
        let path = Path::new("poses.yaml");
        let options = PoseFileOptions::default();
        let parsed = parse(path, yaml, &options).unwrap().entries;
        assert_eq!(parsed[0].name.as_deref(), Some("0.png"));
        assert!(!has_poses(Path::new("poses.txt"), yaml));
        for other in [
            r#"{"camera_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}"#,
            r#"{"T_cam_imu": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}"#,
            r#"[{"position": [0, 0, 0]}]"#,
            r#"{"a": [[[1,0,0,0],[0,1,0,0],[0,0,1,0]]], "b": [[[1,0,0,0],[0,1,0,0],[0,0,1,0]]]}"#,
            "[]",
            "{",
            "1 0 0",
        ] {
            assert!(!has_poses(Path::new("a.json"), other), "{other}");
        }
        let bad = r#"[{"position": [0, 0, 0], "quaternion": [0, 0, 0, 1]}, {"position": 1}]"#;
        let error = parse(Path::new("a.json"), bad, &options)
            .unwrap_err()
            .to_string();
        assert!(error.contains("a.json: pose 2: has neither"), "{error}");
        let scaled = "[[[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]]]";
        let error = parse(Path::new("a.json"), scaled, &options)
            .unwrap_err()
            .to_string();
        assert!(error.contains("scaled by 2"), "{error}");
    }
}
