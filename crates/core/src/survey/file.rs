//! The content of `survey.toml`.

use super::calibrate::CalibrateSection;
use super::camera_sections::CameraSections;
use super::error::SurveyError;
use super::poses_section::PosesSection;
use super::rig_section::RigSection;
use super::tunnel::TunnelSection;
use crate::frames::PictureOrientation;
use crate::storage::{StorageError, StorageUrl};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::limits::MAX_SURVEY_BYTES;
use tunnelstitch_geometry::files::{line_and_column, read_text};
use tunnelstitch_geometry::trajectory::{Jitter, JitterModel, TimeUnit};

/// Name of the file that describes a survey.
pub const SURVEY_FILE: &str = "survey.toml";

/// The content of `survey.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurveyFile {
    /// The tunnel.
    pub tunnel: TunnelSection,
    /// The camera, or those of a rig.
    pub camera: CameraSections,
    /// Relation of the cameras of a rig.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<RigSection>,
    /// The frames; those of a rig are named by its cameras.
    #[serde(default)]
    pub frames: FramesSection,
    /// The poses.
    pub poses: PosesSection,
    /// Noise of the initial poses.
    #[serde(default)]
    pub prior: PriorSection,
    /// Self-calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrate: Option<CalibrateSection>,
    /// Options of the program's commands, one table per command, named like the long flags with
    /// underscores. The program applies them; the library ignores them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub options: BTreeMap<String, toml::Table>,
}

impl SurveyFile {
    /// All paths in the file, except those of the frames.
    pub fn paths_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let poses = &mut self.poses;
        let of_cameras = self.camera.all_mut().iter_mut().flat_map(|camera| {
            [
                camera.file.as_mut(),
                camera.mask.as_mut(),
                camera.body_to_camera.as_mut(),
            ]
        });
        [
            self.tunnel.centreline.as_mut(),
            self.tunnel.shape_file.as_mut(),
            self.tunnel.points.as_mut(),
            self.frames.times.as_mut(),
            self.frames.mask.as_mut(),
            Some(&mut poses.initial),
            poses.truth.as_mut(),
            poses.body_to_camera.as_mut(),
            poses.tunnel_frame.as_mut(),
        ]
        .into_iter()
        .chain(of_cameras)
        .flatten()
    }

    /// Patterns of frames on storage.
    ///
    /// # Errors
    /// A malformed address.
    pub fn stored_frames(&self) -> Result<Vec<StorageUrl>, StorageError> {
        let cameras = 0..self.camera.all().len();
        let patterns = cameras.filter_map(|camera| self.frames_of(camera).images);
        let urls: Result<Vec<_>, _> = patterns.map(|text| StorageUrl::parse(&text)).collect();
        Ok(urls?.into_iter().flatten().collect())
    }

    /// The section of the frames that camera `camera` took.
    pub(super) fn frames_of(&self, camera: usize) -> FramesSection {
        let section = &self.camera.all()[camera];
        let own = self.frames.clone();
        FramesSection {
            images: section.frames.clone().or(own.images),
            mask: section.mask.clone().or(own.mask),
            // The times are those of the moments.
            times: own.times.filter(|_| camera == 0),
            ..own
        }
    }
}

/// `[frames]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FramesSection {
    /// Glob pattern of the frames, if they are files of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub images: Option<String>,
    /// The video that contains the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub video: Option<PathBuf>,
    /// The recording (MCAP, ROS 1 bag) that contains the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bag: Option<PathBuf>,
    /// The topic of the frames in the recording; by default the only one with images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Sampling interval: every so many-th picture of the video or recording is a frame, from the
    /// first on; every picture by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<usize>,
    /// Keyframe selection: rotation between consecutive frames by the initial poses, degrees; the
    /// poses must be associated by time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_step_deg: Option<f64>,
    /// A file of the frames' times, if they are not in the names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<PathBuf>,
    /// The unit of the times in that file, or in the names; by default the number of digits tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<TimeUnit>,
    /// An image of the frames' size, black where they never show the wall; see
    /// [`crate::frames::Mask`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<PathBuf>,
    /// Bits of the values in picture files of 16 bits: 12 where cameras leave the upper four empty;
    /// by default those of the brightest value of all frames, if it leaves upper bits empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bits: Option<u8>,
    /// Orientation of pictures that are to be turned for display; by default as stored, unless the
    /// calibration fits the turned ones only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<PictureOrientation>,
    /// True to leave out picture files that cannot be read; they are an error by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skip_bad: Option<bool>,
    /// Use of pixels that do not move with the wall; they are left out by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlay: Option<OverlayUse>,
}

/// `overlay`: use of pixels that do not move with the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OverlayUse {
    /// They are left out.
    LeaveOut,
    /// They are not sought, and used as all others.
    Keep,
}

/// `[prior]`: the noise model of the initial poses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorSection {
    /// Correlation of the errors of consecutive poses.
    pub model: JitterModel,
    /// 1-σ about each axis, degrees.
    pub rotation_sigma_deg: f64,
    /// 1-σ along x, y, z, metres.
    pub translation_sigma_m: [f64; 3],
}

impl Default for PriorSection {
    /// The paper's experiment: 2° and (2, 2, 3) cm per step, accumulating.
    fn default() -> Self {
        Self {
            model: JitterModel::RandomWalk,
            rotation_sigma_deg: 2.0,
            translation_sigma_m: [0.02, 0.02, 0.03],
        }
    }
}

impl From<PriorSection> for Jitter {
    fn from(prior: PriorSection) -> Self {
        Self {
            model: prior.model,
            rotation_sigma_rad: prior.rotation_sigma_deg.to_radians(),
            translation_sigma_m: prior.translation_sigma_m,
        }
    }
}

/// Reads `survey.toml`.
///
/// # Errors
/// An unreadable file; text that is no TOML, unknown or missing keys, with line and column.
pub(super) fn read_survey_file(path: &Path) -> Result<SurveyFile, SurveyError> {
    let text = read_text(path, MAX_SURVEY_BYTES).map_err(|source| SurveyError::Read {
        path: path.to_owned(),
        source,
    })?;
    toml::from_str(&text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        let [line, column] = line_and_column(&text, at);
        SurveyError::Parse {
            path: path.to_owned(),
            line,
            column,
            what: format!(
                "{}{}{}",
                error.message().replace('\n', " "),
                slip(&text, at),
                meant_key(error.message())
            ),
        }
    })
}

/// The keys that an unknown one is the beginning of, as `radius` of `radius_m`, or the plural of;
/// empty if there are none.
fn meant_key(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(given) = quoted
        .next()
        .filter(|_| message.starts_with("unknown field"))
    else {
        return String::new();
    };
    let is_meant = |known: &&str| {
        known.starts_with(given) || given.strip_suffix('s').is_some_and(|one| one == *known)
    };
    let meant: Vec<String> = quoted
        .filter(is_meant)
        .map(|key| format!("`{key}`"))
        .collect();
    match meant.is_empty() {
        true => String::new(),
        false => format!("; `{given}` may mean {}", meant.join(" or ")),
    }
}

/// The remedy of a slip at a byte where a text stops to be TOML; empty if it is none that people
/// often make.
fn slip(text: &str, at: usize) -> &'static str {
    let Some((before, after)) = text.split_at_checked(at) else {
        return "";
    };
    let line = before.rsplit('\n').next().unwrap_or_default();
    let mut signs = after.chars();
    match (signs.next(), signs.next()) {
        (Some(','), Some('0'..='9')) => "; decimals follow a point, as in 3.0",
        _ if line.contains('"') && line.contains('\\') => {
            "; between double quotes, `\\` begins an escape: write `/`, or single quotes"
        }
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::associate::Associate;
    use crate::survey::calibrate::CalibrationGroup;
    use crate::survey::camera_section::CameraSection;
    use crate::survey::ignore::IgnoreSection;
    use crate::survey::open::Survey;
    use crate::survey::tunnel::Shape;
    use tunnelstitch_geometry::trajectory::{
        CameraAxes, Direction, PoseColumn, PoseFormat, QuaternionOrder,
    };

    #[test]
    fn the_file_round_trips() {
        let file = SurveyFile {
            tunnel: TunnelSection {
                shape: Shape::Box,
                radius_m: None,
                width_m: Some(4.0),
                height_m: Some(3.0),
                centreline: Some("curve.txt".into()),
                shape_file: None,
                points: None,
                shape_sigma_mm: None,
                radius_sigma_percent: Some(0.5),
                ignore: vec![IgnoreSection {
                    theta_deg: Some([150.0, 210.0]),
                    chainage_m: None,
                }],
            },
            camera: CameraSection {
                readout_ms: Some(-20.0),
                max_range_m: Some(9.0),
                ..CameraSection::of_file("camera.json")
            }
            .into(),
            rig: None,
            frames: FramesSection {
                images: None,
                video: Some("survey.mp4".into()),
                bag: None,
                topic: None,
                every: Some(5),
                angle_step_deg: Some(15.0),
                times: Some("times.txt".into()),
                time_unit: Some(TimeUnit::Ms),
                mask: Some("mask.png".into()),
                bits: None,
                orientation: None,
                skip_bad: Some(true),
                overlay: Some(OverlayUse::Keep),
            },
            poses: PosesSection {
                format: Some(PoseFormat::Csv),
                columns: [(PoseColumn::Tx, "px".to_owned())].into(),
                quaternion: Some(QuaternionOrder::Wxyz),
                time_unit: Some(TimeUnit::Us),
                convention: Some(Direction::WorldToCamera),
                camera_axes: Some(CameraAxes::OpenGl),
                associate: Some(Associate::Time),
                time_tolerance_s: Some(0.05),
                interpolate: Some(true),
                body_to_camera: Some("sensor.yaml".into()),
                ..PosesSection::of("baseline.csv")
            },
            prior: PriorSection::default(),
            calibrate: Some(CalibrateSection {
                unknowns: CalibrationGroup::ALL.to_vec(),
                ..CalibrateSection::default()
            }),
            options: BTreeMap::new(),
        };
        let text = toml::to_string(&file).unwrap();
        assert_eq!(toml::from_str::<SurveyFile>(&text).unwrap(), file);
    }

    #[test]
    fn an_unknown_unknown_is_named_with_what_is_possible() {
        let error = toml::from_str::<CalibrateSection>("unknowns = [\"focus\"]").unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains("focus") && message.contains("`centre`"),
            "{message}"
        );
    }

    #[test]
    fn an_unknown_key_is_named_with_its_line_and_column() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(SURVEY_FILE);
        std::fs::write(&path, "[tunnel]\nshape = \"circle\"\n  raduis_m = 3.0\n").unwrap();
        let message = Survey::open(dir.path()).unwrap_err().to_string();
        assert!(
            message.contains("survey.toml:3:3: unknown field `raduis_m`"),
            "{message}"
        );
        assert!(!message.contains("may mean"), "{message}");
        std::fs::write(&path, "[tunnel]\nshape = \"circle\"\nradius = 3.0\n").unwrap();
        let message = Survey::open(dir.path()).unwrap_err().to_string();
        let meant = "`radius` may mean `radius_m` or `radius_sigma_percent`";
        assert!(message.contains(meant), "{message}");
    }
}
