//! The parts of a survey in a recording.

use crate::frames::{FrameError, FrameFile, RecordedImages};
use std::cmp::Reverse;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tunnelstitch_geometry::camera::{Camera, read_calibration};
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::recordings::{MessageKind, PoseTopic, Recording, Topic, TopicGroup};
use tunnelstitch_geometry::trajectory::{
    DuplicateTimes, PoseFile, PoseFileOptions, read_poses_with,
};

/// The topics of a recording that a survey is made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedParts {
    /// The file, relative to the searched folder.
    pub path: PathBuf,
    /// The images, of the topic that has most.
    pub images: Option<RecordedFrames>,
    /// The topic of the poses.
    pub poses: Option<String>,
    /// The topic of the calibration.
    pub calibration: Option<String>,
}

/// The images of a topic.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedFrames {
    /// The topic.
    pub topic: String,
    /// Number of images.
    pub count: usize,
    /// Width and height of the first image, pixels, if it can be read.
    pub size: Option<(u32, u32)>,
    /// The other topics with images.
    pub others: Vec<String>,
}

/// The parts of a recording with what they hold.
pub(super) struct FoundInRecording {
    pub parts: RecordedParts,
    pub poses: Option<PoseFile>,
    pub camera: Option<Camera>,
    /// The topics of poses and calibrations that cannot be read, with the reasons.
    pub refusals: Vec<String>,
}

impl FoundInRecording {
    /// Finds the parts of the recording `file` in `folder`.
    ///
    /// # Errors
    /// A recording that cannot be read, or that has none of the parts, in words.
    pub fn of(folder: &Path, file: &Path) -> Result<Self, String> {
        let path = folder.join(file);
        let recording = Recording::open(&path).map_err(|error| error.reason())?;
        let images = frames(&recording).map_err(|error| error.to_string())?;
        let mut refusals = Vec::new();
        let poses = poses(&recording, &mut refusals);
        let near = images.as_ref().map_or("", |images| images.topic.as_str());
        let calibration = calibration(&recording, near, &mut refusals);
        if images.is_none() && poses.is_none() && calibration.is_none() {
            refusals.insert(
                0,
                "a recording without images, poses and calibrations".to_owned(),
            );
            return Err(refusals.join("; "));
        }
        let (poses_topic, poses) = poses.unzip();
        let (calibration, camera) = calibration.unzip();
        Ok(Self {
            parts: RecordedParts {
                path: file.to_owned(),
                images,
                poses: poses_topic,
                calibration,
            },
            poses,
            camera,
            refusals,
        })
    }
}

/// The topics of a group, those with most messages first.
fn by_count(recording: &Recording, group: TopicGroup) -> Vec<&Topic> {
    let mut topics: Vec<&Topic> = recording.topics(group).collect();
    topics.sort_by_key(|topic| Reverse(topic.count));
    topics
}

/// The images of the topic that has most.
fn frames(recording: &Recording) -> Result<Option<RecordedFrames>, FrameError> {
    let topics = by_count(recording, TopicGroup::Images);
    let [first, others @ ..] = topics.as_slice() else {
        return Ok(None);
    };
    let images = Arc::new(RecordedImages::of(recording.clone(), Some(&first.name))?);
    Ok(Some(RecordedFrames {
        topic: first.name.clone(),
        count: first.count,
        size: FrameFile::in_recording(0, &images, 0).size().ok(),
        others: others.iter().map(|topic| topic.name.clone()).collect(),
    }))
}

/// The first topic of poses that can be read, transforms last.
fn poses(recording: &Recording, refusals: &mut Vec<String>) -> Option<(String, PoseFile)> {
    let mut topics = by_count(recording, TopicGroup::Poses);
    let is_transforms = |topic: &Topic| matches!(topic.content, Some((MessageKind::Transforms, _)));
    topics.sort_by_key(|topic| is_transforms(topic));
    topics.into_iter().find_map(|topic| {
        let options = PoseFileOptions {
            recorded: PoseTopic {
                topic: Some(topic.name.clone()),
                ..PoseTopic::default()
            },
            duplicate_times: DuplicateTimes::Merge,
            ..PoseFileOptions::default()
        };
        let read = read_poses_with(recording.path(), &options);
        Some((topic.name.clone(), taken(read, recording, refusals)?))
    })
}

/// The first calibration that can be read; that of the images' namespace (`/camera/camera_info`
/// beside `/camera/image_raw`) is tried first.
fn calibration(
    recording: &Recording,
    images: &str,
    refusals: &mut Vec<String>,
) -> Option<(String, Camera)> {
    let namespace = |name: &str| name.rsplit_once('/').map(|(space, _)| space.to_owned());
    let mut topics = by_count(recording, TopicGroup::Calibrations);
    topics.sort_by_key(|topic| {
        let space = namespace(&topic.name).unwrap_or_default();
        !images.starts_with(&(space + "/"))
    });
    topics.into_iter().find_map(|topic| {
        let camera = read_calibration(recording.path(), Some(&topic.name));
        Some((topic.name.clone(), taken(camera, recording, refusals)?))
    })
}

/// A part that can be read; else the reason is added to the refusals.
fn taken<T, E: Display>(
    read: Result<T, E>,
    recording: &Recording,
    refusals: &mut Vec<String>,
) -> Option<T> {
    let own = printed(recording.path()).to_string();
    read.map_err(|error| {
        let said = error.to_string();
        let said = said.strip_prefix(&own).unwrap_or(&said);
        refusals.push(said.trim_start_matches([':', ' ']).to_owned());
    })
    .ok()
}
