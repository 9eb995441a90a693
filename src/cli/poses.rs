//! Which poses a command takes, and how they are to be read.

use super::{Failure, Terminal};
use crate::survey::{Associate, PosesSection, Survey, SurveyFile};
use crate::trajectory::{CameraAxes, Direction, PoseFormat, Trajectory};
use clap::ValueEnum;
use std::path::{Path, PathBuf};

/// How poses are read: what section poses of survey.toml says, unless these flags say otherwise.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Reading poses (over survey.toml)")]
pub struct ReadingArguments {
    /// Format of the poses [default: told by their content].
    #[arg(long, value_enum, value_name = "FORMAT")]
    pose_format: Option<FormatArgument>,
    /// Which way the poses lead: from camera to world, or from world to camera
    /// [default: the format's own].
    #[arg(long, value_enum, value_name = "C2W|W2C")]
    pose_convention: Option<DirectionArgument>,
    /// Axes of the camera: y down and z forward, or y up and z backwards
    /// [default: the format's own].
    #[arg(long, value_enum, value_name = "AXES")]
    camera_axes: Option<AxesArgument>,
    /// The motion from the body (IMU) whose poses these are to the camera: a 4 × 4 matrix, EuRoC's
    /// sensor.yaml (T_BS), or a camchain of Kalibr (T_cam_imu).
    #[arg(long, value_name = "FILE")]
    body_to_camera: Option<PathBuf>,
    /// Where the tunnel's axis lies in the poses' world: JSON {"point_m": [x, y, z], "axis":
    /// [x, y, z], "theta_zero": [x, y, z]} (the last is optional), or a 4 × 4 matrix from the
    /// tunnel's frame (y along the axis) to the world.
    #[arg(long, value_name = "FILE")]
    tunnel_frame: Option<PathBuf>,
    /// What ties poses to frames [default: names if the file has any, else the order].
    #[arg(long, value_enum, value_name = "HOW")]
    associate: Option<AssociateArgument>,
    /// Times of the frames: `time`, `time name` or `name time` a line, seconds or whole nanoseconds
    /// [default: told by the frames' names].
    #[arg(long, value_name = "FILE")]
    frame_times: Option<PathBuf>,
    /// With --associate time: the pose nearest to a frame may be this far from it, seconds
    /// [default: 0.01].
    #[arg(long, value_name = "S")]
    time_tolerance_s: Option<f64>,
    /// With --associate time: take the pose on the way between the two around a frame, rather than
    /// the nearer one.
    #[arg(long)]
    interpolate: bool,
}

/// Formats by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormatArgument {
    /// time tx ty tz qx qy qz qw.
    Tum,
    /// The twelve numbers of a 3 × 4 matrix.
    Kitti,
    /// Columns named in the first line.
    Csv,
    /// COLMAP's text model: its folder, or images.txt.
    Colmap,
    /// nerfstudio's transforms.json.
    Nerfstudio,
    /// EuRoC's csv of a body's poses.
    Euroc,
}

/// Directions by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum DirectionArgument {
    /// From camera to world.
    C2w,
    /// From world to camera.
    W2c,
}

/// Axes by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AxesArgument {
    /// x right, y down, z forward.
    Opencv,
    /// x right, y up, z backwards.
    Opengl,
}

/// Ties by name.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AssociateArgument {
    /// The first pose belongs to the first frame, and so on.
    Order,
    /// The frames' names in the file of poses.
    Name,
    /// The frames' times.
    Time,
}

impl From<FormatArgument> for PoseFormat {
    fn from(format: FormatArgument) -> Self {
        match format {
            FormatArgument::Tum => Self::Tum,
            FormatArgument::Kitti => Self::Kitti,
            FormatArgument::Csv => Self::Csv,
            FormatArgument::Colmap => Self::Colmap,
            FormatArgument::Nerfstudio => Self::Nerfstudio,
            FormatArgument::Euroc => Self::Euroc,
        }
    }
}

impl From<DirectionArgument> for Direction {
    fn from(direction: DirectionArgument) -> Self {
        match direction {
            DirectionArgument::C2w => Self::CameraToWorld,
            DirectionArgument::W2c => Self::WorldToCamera,
        }
    }
}

impl From<AxesArgument> for CameraAxes {
    fn from(axes: AxesArgument) -> Self {
        match axes {
            AxesArgument::Opencv => Self::OpenCv,
            AxesArgument::Opengl => Self::OpenGl,
        }
    }
}

impl From<AssociateArgument> for Associate {
    fn from(how: AssociateArgument) -> Self {
        match how {
            AssociateArgument::Order => Self::Order,
            AssociateArgument::Name => Self::Name,
            AssociateArgument::Time => Self::Time,
        }
    }
}

impl ReadingArguments {
    /// Opens a survey, reading its poses as the flags say, and prints its warnings.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey.
    pub fn open(&self, survey: &Path, terminal: &Terminal) -> Result<Survey, Failure> {
        let survey = self.open_quietly(survey)?;
        for warning in &survey.warnings {
            terminal.warn(warning);
        }
        Ok(survey)
    }

    /// The same, its warnings left to the caller.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey.
    pub fn open_quietly(&self, survey: &Path) -> Result<Survey, Failure> {
        Ok(Survey::open_with(survey, |file| self.change(file))?)
    }

    /// Puts what the flags say into a survey's file. Their names are relative to the working
    /// folder, not to the survey's.
    fn change(&self, file: &mut SurveyFile) {
        let poses = &mut file.poses;
        replace(&mut poses.format, self.pose_format.map(Into::into));
        replace(&mut poses.convention, self.pose_convention.map(Into::into));
        replace(&mut poses.camera_axes, self.camera_axes.map(Into::into));
        replace(
            &mut poses.body_to_camera,
            self.body_to_camera.as_deref().map(full),
        );
        replace(
            &mut poses.tunnel_frame,
            self.tunnel_frame.as_deref().map(full),
        );
        replace(&mut poses.associate, self.associate.map(Into::into));
        replace(&mut poses.time_tolerance_s, self.time_tolerance_s);
        replace(&mut poses.interpolate, self.interpolate.then_some(true));
        replace(
            &mut file.frames.times,
            self.frame_times.as_deref().map(full),
        );
    }
}

fn replace<T>(value: &mut Option<T>, other: Option<T>) {
    if other.is_some() {
        *value = other;
    }
}

/// A name that does not depend on the folder it is relative to.
fn full(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Which poses.
#[derive(Clone, Debug, clap::Args)]
pub struct PosesArgument {
    /// Which poses: `initial` and `truth` are those of survey.toml, anything else is a file of any
    /// format. A file is taken to be in the tunnel's frame, as `refine` and `convert` write it,
    /// unless the flags below say otherwise.
    #[arg(
        id = "poses",
        long = "poses",
        default_value = "initial",
        value_name = "initial|truth|FILE"
    )]
    name: String,
    #[command(flatten)]
    reading: ReadingArguments,
}

impl PosesArgument {
    /// The poses in a file, read as `refine` writes them.
    pub fn of_file(file: &Path) -> Self {
        Self {
            name: file.to_string_lossy().into_owned(),
            reading: ReadingArguments::default(),
        }
    }

    /// The file of poses, if it is one.
    pub fn file(&self) -> Option<&Path> {
        match self.name.as_str() {
            "initial" | "truth" => None,
            file => Some(Path::new(file)),
        }
    }

    /// Opens a survey, and finds the poses that `initial`, `truth` or the name of a file stand for.
    ///
    /// A file takes the place of the survey's own poses, and nothing that survey.toml says of those
    /// holds for it.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey; no true poses where they are asked for; a file
    /// that does not hold the frames' poses.
    pub fn open(
        &self,
        survey: &Path,
        terminal: &Terminal,
    ) -> Result<(Survey, Trajectory), Failure> {
        if let Some(path) = self.file() {
            let survey = Survey::open_with(survey, |file| {
                file.poses = PosesSection::of(full(path));
                self.reading.change(file);
            })?;
            for warning in &survey.warnings {
                terminal.warn(warning);
            }
            let poses = survey.initial.clone();
            return Ok((survey, poses));
        }
        let survey = self.reading.open(survey, terminal)?;
        let poses = match (self.name.as_str(), &survey.truth) {
            ("truth", Some(truth)) => truth.clone(),
            ("truth", None) => {
                return Err(Failure::usage(
                    "--poses truth: the survey has no poses.truth; use --poses initial or a file",
                ));
            }
            _ => survey.initial.clone(),
        };
        Ok((survey, poses))
    }
}
