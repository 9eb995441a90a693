//! Poses of recordings: `nav_msgs/Odometry`, `geometry_msgs/PoseStamped` and
//! `PoseWithCovarianceStamped`, `tf2_msgs/TFMessage`; child-to-parent, with the times of their
//! headers. Read only. Source: the definitions of the messages, docs.ros.org.

use super::entry_list::{DuplicateTimes, EntryList, ParsedPoses};
use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::text;
use crate::recordings::{PoseTopic, RecordedPose, Recording, RecordingError};
use nalgebra::Vector3;
use std::path::Path;

/// Reads the poses of a topic. A time that is there twice, as that of a repeated transform, is
/// read once.
pub(super) fn read(path: &Path, topic: &PoseTopic) -> Result<ParsedPoses, PoseError> {
    let poses = Recording::open(path)?.poses(topic)?;
    let mut entries = EntryList::new(DuplicateTimes::Merge);
    for (k, pose) in poses.iter().enumerate() {
        entry(pose)
            .and_then(|entry| entries.push(k + 1, entry))
            .map_err(|what| PoseError::file(path, format!("pose at {} s: {what}", pose.time_s)))?;
    }
    Ok(entries.into_parsed())
}

fn entry(pose: &RecordedPose) -> Result<PoseEntry, String> {
    let [x, y, z, w] = pose.quaternion;
    let position = Vector3::from(pose.position);
    let is_finite = position
        .iter()
        .chain(&pose.quaternion)
        .all(|v| v.is_finite());
    if !is_finite {
        return Err("its numbers are not finite".to_owned());
    }
    Ok(PoseEntry {
        name: None,
        time_s: Some(pose.time_s),
        pose: Pose::new(text::rotation([w, x, y, z], "x y z w")?, position),
    })
}

impl From<RecordingError> for PoseError {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Read { path, source } => Self::Read { path, source },
            RecordingError::Content { path, what } => Self::File { path, what },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::format::PoseFormat;
    use crate::trajectory::pose_file::read_poses_with;
    use crate::trajectory::pose_options::PoseFileOptions;
    use std::path::PathBuf;

    const FILES: [&str; 3] = ["zstd.mcap", "ros1.mcap", "bz2.bag"];
    const START_S: f64 = 1_700_000_000.0;

    /// A recording that other people's writers made (`fixtures/recordings/make.py`).
    fn fixture(name: &str) -> PathBuf {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/recordings");
        folder.join(name)
    }

    #[test]
    fn poses_of_all_kinds_are_read() {
        let of_topic = |topic: &str, parent: Option<&str>| PoseFileOptions {
            recorded: PoseTopic {
                topic: Some(topic.to_owned()),
                parent: parent.map(str::to_owned),
                child: None,
            },
            ..PoseFileOptions::default()
        };
        let topics = [
            of_topic("/odom", None),
            of_topic("/pose", None),
            of_topic("/pose_cov", None),
            of_topic("/tf", Some("map")),
        ];
        for (name, options) in FILES
            .into_iter()
            .flat_map(|n| topics.iter().map(move |t| (n, t)))
        {
            let read = read_poses_with(&fixture(name), options).unwrap();
            assert_eq!(
                (read.format, read.entries.len()),
                (PoseFormat::Recording, 7)
            );
            for (k, entry) in read.entries.iter().enumerate() {
                let time_s = entry.time_s.unwrap() - START_S;
                assert!(
                    (time_s - 0.05 * k as f64).abs() < 1e-6,
                    "{name} {options:?}"
                );
                assert_eq!(entry.pose.t_wc.as_slice(), [0.25 * k as f64, -1.0, 0.5]);
                assert_eq!(entry.pose.r_wc.coords.as_slice(), [0.6, 0.0, 0.0, 0.8]);
            }
        }
    }

    #[test]
    fn impossible_poses_are_named_by_their_time() {
        let pose = |quaternion| RecordedPose {
            time_s: 1.5,
            position: [0.0; 3],
            quaternion,
        };
        assert!(
            entry(&pose([0.0; 4]))
                .unwrap_err()
                .contains("quaternion is zero")
        );
        assert!(
            entry(&pose([f64::NAN; 4]))
                .unwrap_err()
                .contains("not finite")
        );
        let said = read_poses_with(&fixture("lz4.bag"), &PoseFileOptions::default());
        let said = said.unwrap_err().to_string();
        assert!(
            said.contains("several topics of poses") && said.contains("/odom ("),
            "{said}"
        );
    }
}
