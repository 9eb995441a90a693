//! Poses of recordings: `nav_msgs/Odometry`, `geometry_msgs/PoseStamped` and
//! `PoseWithCovarianceStamped`, `tf2_msgs/TFMessage`; child-to-parent, with the times of their
//! headers. Read only. Source: the definitions of the messages, docs.ros.org.

use super::entry_list::{DuplicateTimes, EntryList, ParsedPoses};
use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::text;
use super::transform_tree::{Motion, TransformTree};
use crate::recordings::transforms::plain;
use crate::recordings::{PoseTopic, RecordedPose, Recording, RecordingError, TransformLink};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;

/// Reads the poses of a topic, or of a frame of reference in another through those between them. A
/// time that is there twice, as that of a repeated transform, is read once.
pub(super) fn read(path: &Path, topic: &PoseTopic) -> Result<ParsedPoses, PoseError> {
    let recording = Recording::open(path)?;
    if let Some(chained) = chained(&recording, topic)? {
        return Ok(ParsedPoses::from(chained));
    }
    let poses = recording.poses(topic)?;
    let mut entries = EntryList::new(DuplicateTimes::Merge);
    for (k, pose) in poses.iter().enumerate() {
        entry(pose)
            .and_then(|entry| entries.push(k + 1, entry))
            .map_err(|what| PoseError::file(path, format!("pose at {} s: {what}", pose.time_s)))?;
    }
    Ok(entries.into_parsed())
}

/// The poses of a frame in another; None if the two are not named, if the named topic has them as
/// one transform, or if there are no transforms.
fn chained(recording: &Recording, wanted: &PoseTopic) -> Result<Option<Vec<PoseEntry>>, PoseError> {
    let (Some(fixed), Some(frame)) = (&wanted.parent, &wanted.child) else {
        return Ok(None);
    };
    let links = recording.transform_links(wanted.topic.as_deref())?;
    let (fixed, frame) = (plain(fixed), plain(frame));
    let direct = links.get(&(frame.clone(), fixed.clone()));
    let is_in_topic = wanted.topic.is_some() && direct.is_some_and(|link| !link.is_static);
    if links.is_empty() || is_in_topic {
        return Ok(None);
    }
    let fail = |what: String| PoseError::file(recording.path(), what);
    let mut tree = BTreeMap::new();
    for ((child, parent), link) in links {
        let motion = motion(&link)
            .map_err(|what| fail(format!("transform from {parent} to {child}: {what}")))?;
        tree.insert((child, parent), motion);
    }
    let poses = TransformTree(tree).poses(&fixed, &frame).map_err(fail)?;
    let entry = |(time_s, pose): (f64, Pose)| PoseEntry {
        camera: None,
        name: None,
        time_s: Some(time_s),
        pose,
    };
    Ok(Some(poses.into_iter().map(entry).collect()))
}

/// The motion of a link; of transforms of one time the first counts, of static ones the last.
fn motion(link: &TransformLink) -> Result<Motion, String> {
    let stamped = link.transforms.iter().map(|transform| {
        let entry =
            entry(transform).map_err(|what| format!("at {} s: {what}", transform.time_s))?;
        Ok((transform.time_s, entry.pose))
    });
    let mut stamped = stamped.collect::<Result<Vec<(f64, Pose)>, String>>()?;
    stamped.dedup_by_key(|(time_s, _)| *time_s);
    match stamped.last() {
        Some((_, last)) if link.is_static => Ok(Motion::Static(*last)),
        _ => Ok(Motion::Moving(stamped)),
    }
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
        camera: None,
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
    use nalgebra::{Quaternion, UnitQuaternion};
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

    /// The camera is mounted on the base as the base was at first.
    #[test]
    fn transforms_are_followed_through_the_frames_between() {
        for (name, topic, parent) in FILES
            .into_iter()
            .flat_map(|name| [(name, Some("/tf"), "map"), (name, None, "/map")])
        {
            let options = |child: &str| PoseFileOptions {
                recorded: PoseTopic {
                    topic: topic.map(str::to_owned),
                    parent: Some(parent.to_owned()),
                    child: Some(child.to_owned()),
                },
                ..PoseFileOptions::default()
            };
            let read = read_poses_with(&fixture(name), &options("camera")).unwrap();
            assert_eq!(read.entries.len(), 7, "{name}");
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(0.8, 0.6, 0.0, 0.0));
            for (k, entry) in read.entries.iter().enumerate() {
                let base = Pose::new(turn, Vector3::new(0.25 * k as f64, -1.0, 0.5));
                let expected = base.after(&Pose::new(turn, Vector3::new(0.0, -1.0, 0.5)));
                assert!(
                    entry.pose.local(&expected).norm() < 1e-12,
                    "{name}: {entry:?}"
                );
            }
            let said = read_poses_with(&fixture(name), &options("wheel")).unwrap_err();
            let said = said.to_string();
            assert!(said.contains("there is no frame \"wheel\""), "{said}");
            assert!(
                said.contains("map to base (7), base to camera (7)"),
                "{said}"
            );
        }
    }

    /// `map` to `odom` and `base` to `camera` do not change, and `odom` to `base` does.
    #[test]
    fn static_transforms_hold_at_all_times() {
        let options = |parent: &str| PoseFileOptions {
            recorded: PoseTopic {
                topic: None,
                parent: Some(parent.to_owned()),
                child: Some("camera".to_owned()),
            },
            ..PoseFileOptions::default()
        };
        let path = fixture("transforms.mcap");
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(0.8, 0.6, 0.0, 0.0));
        let at = |k: usize| Pose::new(turn, Vector3::new(0.25 * k as f64, -1.0, 0.5));
        let read = read_poses_with(&path, &options("map")).unwrap();
        assert_eq!(read.entries.len(), 7);
        for (k, entry) in read.entries.iter().enumerate() {
            let expected = at(2).after(&at(k)).after(&at(0));
            assert!(entry.pose.local(&expected).norm() < 1e-12, "{entry:?}");
        }
        let said = read_poses_with(&path, &options("base")).unwrap_err();
        assert!(said.to_string().contains("are static"), "{said}");
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
