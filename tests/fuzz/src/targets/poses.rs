//! Files of poses; the first byte selects text or COLMAP's binary model, the format, detected or
//! given, and the association with frames.

use super::super::{file, small_survey};
use std::path::PathBuf;
use tunnelstitch::survey::{Associate, Survey};
use tunnelstitch::trajectory::{Pose, PoseFormat, read_poses};

const FORMATS: [Option<PoseFormat>; 16] = [
    None,
    Some(PoseFormat::Tum),
    Some(PoseFormat::Kitti),
    Some(PoseFormat::Csv),
    Some(PoseFormat::Colmap),
    Some(PoseFormat::Nerfstudio),
    Some(PoseFormat::Euroc),
    Some(PoseFormat::Opensfm),
    Some(PoseFormat::Bundler),
    Some(PoseFormat::Meshroom),
    Some(PoseFormat::Openmvg),
    Some(PoseFormat::Metashape),
    Some(PoseFormat::Realitycapture),
    Some(PoseFormat::Pix4d),
    Some(PoseFormat::Json),
    Some(PoseFormat::Record3d),
];
const TIES: [Option<Associate>; 4] = [
    None,
    Some(Associate::Order),
    Some(Associate::Name),
    Some(Associate::Time),
];

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let choice = usize::from(first & 0x7f);
    let format = FORMATS[choice % FORMATS.len()];
    // The highest bit is of no consequence for the rest.
    let name = if first & 0x80 == 0 {
        "poses.txt"
    } else {
        "images.bin"
    };
    let (_folder, path) = file(name, content);
    let Ok(read) = read_poses(&path, format) else {
        return;
    };
    let finite = |pose: &Pose| pose.t_wc.iter().all(|v| v.is_finite());
    assert!(read.entries.iter().all(|entry| finite(&entry.pose)));
    let _ = Survey::open_with(small_survey(), |survey| {
        survey.frames.times = (choice % 3 == 0).then(|| PathBuf::from("times.txt"));
        survey.poses.initial = path.clone();
        survey.poses.format = format;
        survey.poses.associate = TIES[choice / FORMATS.len() % TIES.len()];
        survey.poses.interpolate = Some(choice % 2 == 0);
    });
}
