//! Recordings of robots as frames, poses and calibration, and as found by `init`; the first byte
//! selects MCAP or a bag.

use super::super::{file, small_survey};
use std::sync::Arc;
use tunnelstitch::camera::read_calibration;
use tunnelstitch::frames::{FrameFile, RecordedImages, load_colour};
use tunnelstitch::survey::{Discovery, Survey};
use tunnelstitch::trajectory::{PoseFileOptions, read_poses, read_poses_with};

const NAMES: [&str; 2] = ["a.mcap", "a.bag"];
const IMAGES: [Option<&str>; 3] = [
    None,
    Some("/camera/image_raw"),
    Some("/rear/image/compressed"),
];
const POSES: [&str; 3] = ["/odom", "/pose_cov", "/tf"];
/// Names of no frames, and of two with another between them.
const FRAMES: [Option<[&str; 2]>; 2] = [None, Some(["map", "camera"])];
/// Larger pictures only cost time.
const MAX_PX: u32 = 1 << 16;

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let (folder, path) = file(NAMES[usize::from(*first) % NAMES.len()], content);
    let Ok(mut found) = Discovery::of(folder.path()) else {
        return;
    };
    if found.choose_recording() {
        let _ = (found.frames(), found.survey_toml(None));
    }
    let _ = (read_calibration(&path, None), read_poses(&path, None));
    let frames = FRAMES.map(|frames| frames.map(|[parent, child]| (parent, child)).unzip());
    for (topic, (parent, child)) in POSES.into_iter().flat_map(|t| frames.map(|f| (t, f))) {
        let mut options = PoseFileOptions::default();
        options.recorded.topic = Some(topic.to_owned());
        options.recorded.parent = parent.map(str::to_owned);
        options.recorded.child = child.map(str::to_owned);
        if let Ok(read) = read_poses_with(&path, &options) {
            assert!(read.entries.iter().all(|entry| entry.pose.is_finite()));
        }
    }
    for topic in IMAGES {
        let Ok(images) = RecordedImages::open(&path, topic) else {
            continue;
        };
        let images = Arc::new(images);
        for k in 0..images.count().min(4) {
            let frame = FrameFile::in_recording(k, &images, k);
            if let Ok((width, height)) = frame.size()
                && width.saturating_mul(height) <= MAX_PX
            {
                let _ = load_colour(&frame, width, height);
            }
        }
    }
    let _ = Survey::open_with(small_survey(), |survey| {
        survey.frames.images = None;
        survey.frames.bag = Some(path.clone());
        survey.frames.skip_bad = Some(true);
        survey.poses.initial = path.clone();
    });
}
