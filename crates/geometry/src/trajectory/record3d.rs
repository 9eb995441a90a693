//! Record3D's `metadata`: `poses`, each `qx qy qz qw x y z`, camera-to-world with ARKit's axes (y
//! up, z backwards), and `frameTimestamps`, seconds. Its frames are called `0.jpg`, `1.jpg`, ….
//! Source: the exporter's Python examples, record3d 1.3.

use super::entry_list::{EntryList, ParsedPoses};
use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::quaternion_order::QuaternionOrder;
use super::{json_form, pose_options::PoseFileOptions, text};
use nalgebra::Vector3;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
struct Metadata {
    poses: Vec<[f64; 7]>,
    #[serde(rename = "frameTimestamps")]
    times_s: Option<Vec<f64>>,
}

/// Reads `poses` and `frameTimestamps`, of which there are as many or none.
///
/// # Errors
/// Other JSON; quaternions of no rotation; other numbers of times and poses; times that do not
/// increase.
pub(super) fn parse(
    path: &Path,
    text: &str,
    options: &PoseFileOptions,
) -> Result<ParsedPoses, PoseError> {
    let fail = |what: String| PoseError::file(path, what);
    let Metadata { poses, times_s } =
        serde_json::from_str(text).map_err(|error| fail(json_form::mismatch(text, &error)))?;
    if let Some(times_s) = times_s
        .as_ref()
        .filter(|times_s| times_s.len() != poses.len())
    {
        let (poses, times) = (poses.len(), times_s.len());
        return Err(fail(format!(
            "{poses} `poses`, but {times} `frameTimestamps`"
        )));
    }
    let mut list = EntryList::new(options.duplicate_times);
    for (k, [a, b, c, d, x, y, z]) in poses.into_iter().enumerate() {
        let fail = |what: String| fail(format!("poses[{k}]: {what}"));
        let order = QuaternionOrder::Xyzw;
        let rotation = text::rotation(order.wxyz([a, b, c, d]), order.columns()).map_err(fail)?;
        let entry = PoseEntry {
            name: None,
            camera: None,
            time_s: times_s.as_ref().and_then(|times_s| times_s.get(k).copied()),
            pose: Pose::new(rotation, Vector3::new(x, y, z)),
        };
        list.push(k + 1, entry).map_err(fail)?;
    }
    Ok(list.into_parsed())
}

#[cfg(test)]
mod tests {
    use super::super::format::PoseFormat;
    use super::super::pose_file::read_poses;

    #[test]
    fn poses_have_the_times_of_the_frames() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("metadata");
        let read = |times: &str| {
            let text = format!(
                r#"{{"w": 64, "h": 48, "K": [50, 0, 0, 0, 51, 0, 32, 24, 1], "fps": 60,
                "poses": [[0, 0, 0, 1, 1, 2, 3], [0, 0, 1, 0, 1, 2, 4]], {times}
                "initPose": [0, 0, 0, 1, 0, 0, 0]}}"#
            );
            std::fs::write(&path, text).unwrap();
            read_poses(&path, None)
        };
        let file = read("\"frameTimestamps\": [5.5, 5.6],").unwrap();
        assert_eq!(file.format, PoseFormat::Record3d);
        assert_eq!(file.entries[1].time_s, Some(5.6));
        assert_eq!(file.entries[1].pose.t_wc.as_slice(), [1.0, 2.0, 4.0]);
        assert_eq!(
            file.entries[1].pose.r_wc.coords.as_slice(),
            [0.0, 0.0, 1.0, 0.0]
        );
        assert_eq!(read("").unwrap().entries[0].time_s, None);
        let error = read("\"frameTimestamps\": [5.5],").unwrap_err().to_string();
        assert!(error.contains("2 `poses`, but 1"), "{error}");
    }
}
