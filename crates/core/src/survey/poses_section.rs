//! `[poses]`: the pose files and their convention.

use super::associate::Associate;
use super::missing_poses::MissingPoses;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use tunnelstitch_geometry::recordings::{PoseTopic, is_recording};
use tunnelstitch_geometry::trajectory::{
    AngleUnit, CameraAxes, ColumnMap, Direction, DuplicateTimes, EulerSequence, PoseFileOptions,
    PoseFormat, QuaternionOrder, TimeUnit,
};

/// `[poses]`. Defaults are detected from the files' content or given by the conventions of their
/// formats.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosesSection {
    /// The initial poses.
    pub initial: PathBuf,
    /// The true poses, if known; used for comparison only and read like the initial ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<PathBuf>,
    /// The files' format.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub format: Option<PoseFormat>,
    /// The topic of the poses in a recording; by default the only one with poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// The fixed frame (`frame_id`) of transforms in a recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// The frame of the camera (`child_frame_id`) in transforms of a recording; between the two
    /// there may be others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub child: Option<String>,
    /// Names of columns in the headers of CSV files, for columns whose names are not known.
    #[serde(default, skip_serializing_if = "ColumnMap::is_empty")]
    pub columns: ColumnMap,
    /// The order of rotations in CSV files with angles about axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler: Option<EulerSequence>,
    /// The unit of angles in CSV files whose header does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_unit: Option<AngleUnit>,
    /// The order of the quaternion's numbers in TUM files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quaternion: Option<QuaternionOrder>,
    /// The unit of times in TUM files, and in CSV files whose header does not tell; by default
    /// the digits of times since 1970 tell it, and all others are seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<TimeUnit>,
    /// Seconds to add to the times of the files, whose clock may be behind that of the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_offset_s: Option<f64>,
    /// The direction of the poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub convention: Option<Direction>,
    /// The camera's axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_axes: Option<CameraAxes>,
    /// The motion from the body whose poses the files hold to the camera; see
    /// [`read_camera_in_body`](tunnelstitch_geometry::trajectory::read_camera_in_body).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_to_camera: Option<PathBuf>,
    /// The tunnel's frame in the poses' world; see
    /// [`read_tunnel_frame`](tunnelstitch_geometry::trajectory::read_tunnel_frame).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tunnel_frame: Option<PathBuf>,
    /// True if the file's poses are in the reverse order of the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reversed: Option<bool>,
    /// Places by which the initial poses, in the order of `reversed`, belong to later frames; if
    /// negative, to earlier ones. It does not apply to the true poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift_frames: Option<isize>,
    /// Length of the file's unit of positions, metres; 1 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_m: Option<f64>,
    /// The criterion that associates poses with frames; by default their times in a recording,
    /// their names, if the file has any, else their order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub associate: Option<Associate>,
    /// Largest difference between the times of a frame and its pose, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_tolerance_s: Option<f64>,
    /// True to interpolate between the two neighbouring poses, rather than take the nearer one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolate: Option<bool>,
    /// True if the initial poses are those in the tunnel as it was built, false (the default) if
    /// they are those in the tunnel as planned, along whose bend (`shape_file`) they are carried.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub as_built: Option<bool>,
    /// True if the initial poses are a result, in which every frame must have one; else frames that
    /// a file with names leaves out start between their neighbours. No key of `survey.toml`.
    #[serde(skip)]
    pub is_complete: bool,
    /// True while frames are being taken: no poses are read when the survey is opened
    /// ([`Capture`](super::capture::Capture)). No key of `survey.toml`.
    #[serde(skip)]
    pub is_awaited: bool,
}

impl PosesSection {
    /// Treatment of frames that the file of the initial poses leaves out.
    pub(super) fn missing_poses(&self) -> MissingPoses {
        if self.is_complete {
            MissingPoses::Refuse
        } else {
            MissingPoses::Interpolate
        }
    }

    /// The criterion that associates poses with frames, if it does not depend on names in the file.
    pub(super) fn associate(&self) -> Option<Associate> {
        let of_recording = is_recording(&self.initial).then_some(Associate::Time);
        self.associate.or(of_recording)
    }

    /// A section with only the path of the initial poses.
    pub fn of(initial: impl Into<PathBuf>) -> Self {
        Self {
            initial: initial.into(),
            ..Self::default()
        }
    }

    /// The options for reading the files. A time that is there twice is read once if poses are
    /// associated with frames by time; the poses of a rig's pictures share the times of their
    /// moments.
    pub(super) fn file_options(&self, is_rig: bool) -> PoseFileOptions {
        PoseFileOptions {
            format: self.format,
            columns: self.columns.clone(),
            euler: self.euler,
            angle_unit: self.angle_unit,
            quaternion: self.quaternion,
            time_unit: self.time_unit,
            recorded: PoseTopic {
                topic: self.topic.clone(),
                parent: self.parent.clone(),
                child: self.child.clone(),
            },
            duplicate_times: match self.associate {
                Some(Associate::Time) => DuplicateTimes::Merge,
                Some(Associate::Order | Associate::Name) | None if is_rig => DuplicateTimes::Keep,
                Some(Associate::Order | Associate::Name) | None => DuplicateTimes::Refuse,
            },
        }
    }
}
