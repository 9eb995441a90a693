//! `survey.toml`: what a data set is.
//!
//! ```toml
//! [tunnel]
//! shape = "circle"
//! radius_m = 3.0
//!
//! [camera]
//! file = "camera.json"
//! readout_ms = 20.0           # optional: rolling shutter, from the first row to the last
//!
//! [frames]
//! images = "frames/*.jpg"     # sorted by name
//!
//! [poses]
//! initial = "baseline.tum"
//! truth = "groundtruth.tum"   # optional: only for comparison
//!
//! [prior]                     # optional: how far off the initial poses may be
//! model = "random-walk"       # or "independent"
//! rotation_sigma_deg = 2.0
//! translation_sigma_m = [0.02, 0.02, 0.03]
//!
//! [calibrate]                 # optional: what refine estimates besides the poses, around the values given
//! unknowns = ["focal", "centre", "distortion", "radius", "axis"]
//! focal_sigma_percent = 2.0   # 1-σ of the values given; these are the defaults
//! centre_sigma_percent = 1.0  # of the frames' width
//! k1_sigma = 0.05
//! k2_sigma = 0.05
//! radius_sigma_percent = 1.0
//! axis_tilt_sigma_deg = 1.0
//! axis_offset_sigma_m = 0.05
//! ```
//!
//! Relative paths are relative to `survey.toml`. Unknown keys are errors with line and column.

use crate::camera::{CalibrationError, Camera, read_calibration};
use crate::frames::{self, FrameError, FrameFile};
use crate::surface::{Circle, Surface, SurfaceError};
use crate::trajectory::tum::{self, TumError};
use crate::trajectory::{Jitter, JitterModel, Pose, Shutter, Trajectory, poses_of};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the file that describes a survey.
pub const SURVEY_FILE: &str = "survey.toml";

/// Why a survey cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SurveyError {
    /// `survey.toml` cannot be read.
    #[error("{}: cannot read the survey: {source}; a survey is a folder with a survey.toml", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// `survey.toml` is malformed or has an unknown key.
    #[error("{}:{line}:{column}: {what}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// 1-based line.
        line: usize,
        /// 1-based column.
        column: usize,
        /// What the parser said.
        what: String,
    },
    /// A value is impossible.
    #[error("{}: {what}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Which, and what it should be.
        what: String,
    },
    /// Frames and poses do not pair up.
    #[error(
        "{}: {poses} poses for {frames} frames; every frame needs exactly one pose, in the order of the frames' names",
        path.display()
    )]
    Count {
        /// The pose file.
        path: PathBuf,
        /// Poses found.
        poses: usize,
        /// Frames found.
        frames: usize,
    },
    /// A pose does not go with the tunnel.
    #[error("{}: frame {frame}: {source}; check radius_m and the poses' origin and units", path.display())]
    Placement {
        /// The pose file.
        path: PathBuf,
        /// Index of the frame.
        frame: usize,
        /// What is wrong.
        source: SurfaceError,
    },
    /// Calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Frames.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// Trajectory.
    #[error(transparent)]
    Trajectory(#[from] TumError),
}

/// `survey.toml` as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurveyFile {
    /// The tunnel.
    pub tunnel: TunnelSection,
    /// The camera.
    pub camera: CameraSection,
    /// The frames.
    pub frames: FramesSection,
    /// The poses.
    pub poses: PosesSection,
    /// Noise of the initial poses.
    #[serde(default)]
    pub prior: PriorSection,
    /// Self-calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrate: Option<CalibrateSection>,
}

/// Shape of the tunnel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Straight, circular section.
    Circle,
}

/// `[tunnel]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TunnelSection {
    /// Shape of the tunnel.
    pub shape: Shape,
    /// Radius, metres.
    pub radius_m: f64,
}

/// `[camera]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    /// Calibration file.
    pub file: PathBuf,
    /// Which camera, if the file has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Rolling shutter: time from reading a frame's first row to reading its last, milliseconds of the poses' times; negative if
    /// rows are read bottom-up. Time and pose of a frame are those of its middle row. Without it, all rows are read at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readout_ms: Option<f64>,
}

/// `[frames]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FramesSection {
    /// Glob pattern of the frames.
    pub images: String,
}

/// `[poses]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosesSection {
    /// The poses to be refined, TUM.
    pub initial: PathBuf,
    /// The true poses, TUM, where they are known: only ever used for comparison.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<PathBuf>,
}

/// `[prior]`: the noise model of the initial poses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorSection {
    /// How errors of consecutive poses hang together.
    pub model: JitterModel,
    /// 1-σ about each axis, degrees.
    pub rotation_sigma_deg: f64,
    /// 1-σ along x, y, z, metres.
    pub translation_sigma_m: [f64; 3],
}

impl Default for PriorSection {
    /// The paper's experiment: 2° and (2, 2, 3) cm a step, accumulating.
    fn default() -> Self {
        Self {
            model: JitterModel::RandomWalk,
            rotation_sigma_deg: 2.0,
            translation_sigma_m: [0.02, 0.02, 0.03],
        }
    }
}

/// Something that all frames share and `refine` can estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CalibrationGroup {
    /// Focal length; fx and fy grow alike.
    Focal,
    /// Principal point.
    Centre,
    /// Radial distortion, k1 and k2.
    Distortion,
    /// The tunnel's radius.
    Radius,
    /// Where the frame of the initial poses has the tunnel's axis: two tilts and two offsets.
    Axis,
}

impl CalibrationGroup {
    /// All there are.
    pub const ALL: [Self; 5] = [
        Self::Focal,
        Self::Centre,
        Self::Distortion,
        Self::Radius,
        Self::Axis,
    ];
}

/// `[calibrate]`: what is estimated besides the poses, and how far off the given values may be (1-σ).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrateSection {
    /// What is estimated, unless the command line says otherwise.
    pub unknowns: Vec<CalibrationGroup>,
    /// Focal length, percent.
    pub focal_sigma_percent: f64,
    /// Principal point, percent of the frames' width.
    pub centre_sigma_percent: f64,
    /// k1.
    pub k1_sigma: f64,
    /// k2.
    pub k2_sigma: f64,
    /// Radius, percent.
    pub radius_sigma_percent: f64,
    /// Each tilt of the axis, degrees.
    pub axis_tilt_sigma_deg: f64,
    /// Each offset of the axis, metres.
    pub axis_offset_sigma_m: f64,
}

impl Default for CalibrateSection {
    fn default() -> Self {
        Self {
            unknowns: Vec::new(),
            focal_sigma_percent: 2.0,
            centre_sigma_percent: 1.0,
            k1_sigma: 0.05,
            k2_sigma: 0.05,
            radius_sigma_percent: 1.0,
            axis_tilt_sigma_deg: 1.0,
            axis_offset_sigma_m: 0.05,
        }
    }
}

impl CalibrateSection {
    /// What is wrong with the numbers, if anything.
    fn fault(&self) -> Option<String> {
        let sigmas = [
            ("focal_sigma_percent", self.focal_sigma_percent, 30.0),
            ("centre_sigma_percent", self.centre_sigma_percent, 30.0),
            ("k1_sigma", self.k1_sigma, 1.0),
            ("k2_sigma", self.k2_sigma, 1.0),
            ("radius_sigma_percent", self.radius_sigma_percent, 30.0),
            ("axis_tilt_sigma_deg", self.axis_tilt_sigma_deg, 30.0),
            ("axis_offset_sigma_m", self.axis_offset_sigma_m, 100.0),
        ];
        let wrong = sigmas
            .iter()
            .find(|(_, value, most)| !(1e-9..=*most).contains(value));
        wrong.map(|(name, value, most)| {
            format!("calibrate.{name} is {value}; it must be more than 0 and no more than {most}")
        })
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

/// A survey, read and checked: everything but the pixels.
#[derive(Debug)]
pub struct Survey {
    /// The folder of `survey.toml`.
    pub folder: PathBuf,
    /// `survey.toml` as written.
    pub file: SurveyFile,
    /// The camera.
    pub camera: Camera,
    /// The tunnel.
    pub surface: Box<dyn Surface>,
    /// The frames, sorted by name.
    pub frames: Vec<FrameFile>,
    /// The initial poses, one per frame.
    pub initial: Trajectory,
    /// The true poses, one per frame, where known.
    pub truth: Option<Trajectory>,
    /// Noise model of the initial poses.
    pub prior: Jitter,
}

impl Survey {
    /// Reads a survey: `path` is its folder or its `survey.toml`.
    ///
    /// # Errors
    /// Everything that can be wrong before a pixel is read; see [`SurveyError`].
    pub fn open(path: &Path) -> Result<Self, SurveyError> {
        let toml_path = if path.is_dir() {
            path.join(SURVEY_FILE)
        } else {
            path.to_owned()
        };
        let file = read_survey_file(&toml_path)?;
        let folder = match toml_path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let value = |what: String| SurveyError::Value {
            path: toml_path.clone(),
            what,
        };
        let Shape::Circle = file.tunnel.shape;
        let circle = Circle::new(file.tunnel.radius_m)
            .map_err(|error| value(format!("tunnel.radius_m: {error}")))?;
        let prior = &file.prior;
        if !(1e-6..=180.0).contains(&prior.rotation_sigma_deg) {
            return Err(value(format!(
                "prior.rotation_sigma_deg is {}; it must lie between 1e-6 and 180",
                prior.rotation_sigma_deg
            )));
        }
        if !prior
            .translation_sigma_m
            .iter()
            .all(|s| (1e-9..=10.0 * file.tunnel.radius_m).contains(s))
        {
            return Err(value(format!(
                "prior.translation_sigma_m is {:?}; all three must lie between 1e-9 and ten times the radius",
                prior.translation_sigma_m
            )));
        }
        if let Some(fault) = file.calibrate.as_ref().and_then(CalibrateSection::fault) {
            return Err(value(fault));
        }
        let camera =
            read_calibration(&folder.join(&file.camera.file), file.camera.name.as_deref())?;
        let frames = frames::list(&folder, &file.frames.images)?;
        let surface: Box<dyn Surface> = Box::new(circle);
        let mut survey = Self {
            camera,
            surface,
            frames,
            initial: Vec::new(),
            truth: None,
            prior: file.prior.into(),
            folder,
            file,
        };
        survey.initial = survey.read_poses(&survey.folder.join(&survey.file.poses.initial))?;
        if let Some(fault) = survey.readout_fault() {
            return Err(value(fault));
        }
        survey.truth = match &survey.file.poses.truth {
            Some(truth) => Some(survey.read_poses(&survey.folder.join(truth))?),
            None => None,
        };
        Ok(survey)
    }

    /// Reads a pose file and checks it against the frames and the tunnel.
    ///
    /// # Errors
    /// A malformed file, a number of poses other than that of the frames, a camera outside the tunnel.
    pub fn read_poses(&self, path: &Path) -> Result<Trajectory, SurveyError> {
        let trajectory = tum::read(path)?;
        if trajectory.len() != self.frames.len() {
            return Err(SurveyError::Count {
                path: path.to_owned(),
                poses: trajectory.len(),
                frames: self.frames.len(),
            });
        }
        for (frame, stamped) in trajectory.iter().enumerate() {
            self.surface
                .check_inside(&stamped.pose.t_wc)
                .map_err(|source| SurveyError::Placement {
                    path: path.to_owned(),
                    frame,
                    source,
                })?;
        }
        Ok(trajectory)
    }

    /// What is wrong with the readout time, if anything: no row of a frame can be read after the next frame's.
    fn readout_fault(&self) -> Option<String> {
        let readout_ms = self.file.camera.readout_ms?;
        let steps = self
            .initial
            .windows(2)
            .map(|pair| pair[1].time_s - pair[0].time_s);
        let shortest_ms = 1e3 * steps.fold(f64::INFINITY, f64::min);
        let possible = readout_ms.is_finite() && readout_ms.abs() <= shortest_ms;
        (!possible).then(|| {
            format!(
                "camera.readout_ms is {readout_ms}; it must be a number of milliseconds and no more than the {shortest_ms:.3} ms between \
                 the times of the nearest two poses in {}",
                self.file.poses.initial.display()
            )
        })
    }

    /// When the rows of the frames are read, by the times of the initial poses.
    pub fn shutter(&self) -> Shutter {
        let readout_s = 1e-3 * self.file.camera.readout_ms.unwrap_or_default();
        Shutter::new(readout_s, self.camera.height, &self.initial)
    }

    /// The initial poses without their times.
    pub fn initial_poses(&self) -> Vec<Pose> {
        poses_of(&self.initial)
    }
}

fn read_survey_file(path: &Path) -> Result<SurveyFile, SurveyError> {
    let text = std::fs::read_to_string(path).map_err(|source| SurveyError::Read {
        path: path.to_owned(),
        source,
    })?;
    toml::from_str(&text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start.min(text.len()));
        let before = &text.as_bytes()[..at];
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        let column = 1 + before
            .iter()
            .rev()
            .take_while(|byte| **byte != b'\n')
            .count();
        SurveyError::Parse {
            path: path.to_owned(),
            line,
            column,
            what: error.message().replace('\n', " "),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_round_trips() {
        let file = SurveyFile {
            tunnel: TunnelSection {
                shape: Shape::Circle,
                radius_m: 3.0,
            },
            camera: CameraSection {
                file: "camera.json".into(),
                name: None,
                readout_ms: Some(-20.0),
            },
            frames: FramesSection {
                images: "frames/*.png".into(),
            },
            poses: PosesSection {
                initial: "baseline.tum".into(),
                truth: None,
            },
            prior: PriorSection::default(),
            calibrate: Some(CalibrateSection {
                unknowns: CalibrationGroup::ALL.to_vec(),
                ..CalibrateSection::default()
            }),
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
    }
}
