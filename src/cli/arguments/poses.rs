//! Arguments that select poses and say how they are read.

use super::input_file::input_file;
use crate::cli::output::{Failure, Terminal};
use crate::report::REFINEMENT_FILE;
use crate::survey::{Associate, PosesSection, SURVEY_FILE, Survey, SurveyError, SurveyFile};
use crate::trajectory::{
    AngleUnit, CameraAxes, Direction, EulerSequence, PoseColumn, PoseFormat, QuaternionOrder,
    Trajectory,
};
use clap::ValueEnum;
use std::path::{Path, PathBuf};

/// Flags for reading poses; each replaces its key of the section poses in survey.toml.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Reading poses (overrides survey.toml)")]
pub struct PoseReadingArguments {
    /// Format of the poses [default: detected from the content].
    #[arg(long, value_enum, value_name = "FORMAT")]
    pose_format: Option<FormatArgument>,
    /// Names of columns in the header of a CSV file, for columns whose names are not known:
    /// COLUMN is frame, time_s, time_ns, tx, ty, tz, qx, qy, qz, qw, or rx, ry, rz for angles.
    #[arg(
        long,
        value_name = "COLUMN=NAME",
        value_delimiter = ',',
        value_parser = parse_column
    )]
    pose_columns: Vec<(PoseColumn, String)>,
    /// Order of rotations in a CSV file with angles about axes (roll, pitch, yaw): ZYX for R =
    /// Rz(yaw) Ry(pitch) Rx(roll), XYZ for omega, phi, kappa; small letters for fixed axes.
    #[arg(long, value_name = "ORDER")]
    pose_euler: Option<EulerSequence>,
    /// Unit of these angles: deg or rad [default: as the header tells].
    #[arg(long, value_enum, value_name = "UNIT")]
    pose_angle_unit: Option<AngleUnitArgument>,
    /// Order of the quaternion in TUM files: xyzw or wxyz [default: as a comment before the poses
    /// names it, or xyzw].
    #[arg(long, value_enum, value_name = "ORDER")]
    pose_quaternion: Option<QuaternionArgument>,
    /// Topic of the poses, if they are in a recording that has several.
    #[arg(long, value_name = "TOPIC")]
    pose_topic: Option<String>,
    /// Direction of the poses: camera to world (c2w) or world to camera (w2c)
    /// [default: that of the format].
    #[arg(long, value_enum, value_name = "C2W|W2C")]
    pose_convention: Option<DirectionArgument>,
    /// Axes of the camera: opencv (y down, z forward), opengl (y up, z backwards), ros (z up, x
    /// forward) or unity (y up, z forward, left-handed)
    /// [default: those of the format].
    #[arg(long, value_enum, value_name = "AXES")]
    camera_axes: Option<AxesArgument>,
    /// Extrinsics between the body (IMU) whose poses these are and the camera: a 4 × 4 matrix,
    /// EuRoC's sensor.yaml (T_BS), or a camchain of Kalibr (T_cam_imu).
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    body_to_camera: Option<PathBuf>,
    /// Axis of the tunnel in the world frame of the poses: JSON {"point_m": [x, y, z], "axis":
    /// [x, y, z], "theta_zero": [x, y, z]} (the last is optional), or a 4 × 4 matrix from the
    /// tunnel's frame (y along the axis) to the world.
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    tunnel_frame: Option<PathBuf>,
    /// Association of poses with frames [default: by name if the file has names, else by order].
    #[arg(long, value_enum, value_name = "HOW")]
    associate: Option<AssociateArgument>,
    /// File with the times of the frames, one a line: `time`, `time name` or `name time`, in
    /// seconds or whole nanoseconds [default: from the frames' names].
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    frame_times: Option<PathBuf>,
    /// With --associate time: largest time difference between a frame and its nearest pose, seconds
    /// [default: 0.01].
    #[arg(long, value_name = "S")]
    time_tolerance_s: Option<f64>,
    /// With --associate time: interpolate between the poses before and after a frame instead of
    /// taking the nearer one.
    #[arg(long)]
    interpolate: bool,
    /// Topic of the frames, if they are in a recording that has several with images.
    #[arg(
        long,
        value_name = "TOPIC",
        help_heading = "Reading frames (overrides survey.toml)"
    )]
    frame_topic: Option<String>,
    /// Leave out frames whose files cannot be read (missing, damaged, or not of the calibration's
    /// size), with a warning that names them, instead of failing. All frames are decoded once more
    /// for it. What `refine` has made so is read so by other commands.
    #[arg(long, help_heading = "Reading frames (overrides survey.toml)")]
    skip_bad: bool,
}

/// Names of formats.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormatArgument {
    /// time tx ty tz qx qy qz qw.
    Tum,
    /// The twelve numbers of a 3 × 4 matrix.
    Kitti,
    /// Columns named in the first line.
    Csv,
    /// COLMAP's model: its folder, images.txt or images.bin.
    Colmap,
    /// nerfstudio's transforms.json.
    Nerfstudio,
    /// EuRoC's csv of a body's poses.
    Euroc,
    /// OpenSfM's reconstruction.json.
    Opensfm,
    /// Bundler's bundle.out with its list of names.
    Bundler,
    /// Meshroom's cameras.sfm.
    Meshroom,
    /// OpenMVG's sfm_data.json.
    Openmvg,
    /// Metashape's cameras in XML.
    Metashape,
    /// RealityCapture's CSV of cameras.
    Realitycapture,
    /// Pix4D's calibrated external camera parameters.
    Pix4d,
    /// JSON or YAML of your own with matrices, or positions and quaternions.
    Json,
    /// Record3D's metadata.
    Record3d,
}

/// Names of orders of quaternions.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum QuaternionArgument {
    /// qx qy qz qw.
    Xyzw,
    /// qw qx qy qz.
    Wxyz,
}

/// Names of units of angles.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AngleUnitArgument {
    /// Degrees.
    Deg,
    /// Radians.
    Rad,
}

impl From<AngleUnitArgument> for AngleUnit {
    fn from(unit: AngleUnitArgument) -> Self {
        match unit {
            AngleUnitArgument::Deg => Self::Deg,
            AngleUnitArgument::Rad => Self::Rad,
        }
    }
}

/// Names of directions.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum DirectionArgument {
    /// From camera to world.
    C2w,
    /// From world to camera.
    W2c,
}

/// Names of camera axes.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AxesArgument {
    /// x right, y down, z forward.
    Opencv,
    /// x right, y up, z backwards.
    Opengl,
    /// x forward, y left, z up: a body of ROS.
    Ros,
    /// x right, y up, z forward, in a left-handed world.
    Unity,
    /// x down, y left, z forward: pictures were turned clockwise after the camera stored them.
    TurnedRight,
    /// x up, y right, z forward: pictures were turned anticlockwise after that.
    TurnedLeft,
}

/// Names of associations.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AssociateArgument {
    /// By order: the first pose belongs to the first frame, and so on.
    Order,
    /// By the frames' names in the file of poses.
    Name,
    /// By the frames' times.
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
            FormatArgument::Opensfm => Self::Opensfm,
            FormatArgument::Bundler => Self::Bundler,
            FormatArgument::Meshroom => Self::Meshroom,
            FormatArgument::Openmvg => Self::Openmvg,
            FormatArgument::Metashape => Self::Metashape,
            FormatArgument::Realitycapture => Self::Realitycapture,
            FormatArgument::Pix4d => Self::Pix4d,
            FormatArgument::Json => Self::Json,
            FormatArgument::Record3d => Self::Record3d,
        }
    }
}

impl From<QuaternionArgument> for QuaternionOrder {
    fn from(order: QuaternionArgument) -> Self {
        match order {
            QuaternionArgument::Xyzw => Self::Xyzw,
            QuaternionArgument::Wxyz => Self::Wxyz,
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
            AxesArgument::Ros => Self::Ros,
            AxesArgument::Unity => Self::Unity,
            AxesArgument::TurnedRight => Self::TurnedRight,
            AxesArgument::TurnedLeft => Self::TurnedLeft,
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

impl PoseReadingArguments {
    /// Opens a survey, its poses read according to the flags, with the file of measured points
    /// `points` instead of its own, if there is one, and prints its warnings.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey.
    pub fn open(
        &self,
        survey: &Path,
        points: Option<&Path>,
        terminal: &Terminal,
    ) -> Result<Survey, Failure> {
        let opened = Survey::open_with(survey, |file| {
            self.apply_to(file);
            replace(&mut file.tunnel.points, points.map(absolute));
        })?;
        Ok(warned(opened, terminal))
    }

    /// Opens a survey, its poses read according to the flags, and prints nothing.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey.
    pub fn open_quietly(&self, survey: &Path) -> Result<Survey, Failure> {
        Ok(Survey::open_with(survey, |file| self.apply_to(file))?)
    }

    /// Opens a survey as [`PoseReadingArguments::open`] does, with the camera and the wall that
    /// `refine` has written beside the poses `refined`, if it has.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey.
    pub fn open_beside(
        &self,
        survey: &Path,
        refined: &Path,
        terminal: &Terminal,
    ) -> Result<Survey, Failure> {
        let opened = open_as_found(survey, Some(refined), |file| self.apply_to(file))?;
        Ok(warned(opened, terminal))
    }

    /// Writes the flags into a survey's file. Their paths are relative to the working folder, not
    /// to the survey's.
    pub fn apply_to(&self, file: &mut SurveyFile) {
        let poses = &mut file.poses;
        replace(&mut poses.format, self.pose_format.map(Into::into));
        poses.columns.extend(self.pose_columns.iter().cloned());
        replace(&mut poses.topic, self.pose_topic.clone());
        replace(&mut poses.euler, self.pose_euler);
        replace(&mut poses.angle_unit, self.pose_angle_unit.map(Into::into));
        replace(&mut poses.quaternion, self.pose_quaternion.map(Into::into));
        replace(&mut poses.convention, self.pose_convention.map(Into::into));
        replace(&mut poses.camera_axes, self.camera_axes.map(Into::into));
        replace(
            &mut poses.body_to_camera,
            self.body_to_camera.as_deref().map(absolute),
        );
        replace(
            &mut poses.tunnel_frame,
            self.tunnel_frame.as_deref().map(absolute),
        );
        replace(&mut poses.associate, self.associate.map(Into::into));
        replace(&mut poses.time_tolerance_s, self.time_tolerance_s);
        replace(&mut poses.interpolate, self.interpolate.then_some(true));
        replace(
            &mut file.frames.times,
            self.frame_times.as_deref().map(absolute),
        );
        replace(&mut file.frames.topic, self.frame_topic.clone());
        replace(&mut file.frames.skip_bad, self.skip_bad.then_some(true));
    }
}

/// Parses `COLUMN=NAME`.
fn parse_column(argument: &str) -> Result<(PoseColumn, String), String> {
    let (column, name) = argument
        .split_once('=')
        .ok_or("it must be COLUMN=NAME, as tx=east")?;
    Ok((column.parse()?, name.to_owned()))
}

fn replace<T>(value: &mut Option<T>, other: Option<T>) {
    if other.is_some() {
        *value = other;
    }
}

/// An absolute path, links not resolved.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// The poses that survey.toml names as initial ones.
const INITIAL: &str = "initial";
/// Its true poses.
const TRUTH: &str = "truth";

/// Poses that a command uses.
#[derive(Clone, Debug, clap::Args)]
pub struct PosesArguments {
    /// Poses to use: `initial` and `truth` are those of survey.toml; anything else is a file in any
    /// supported format, in the tunnel's frame as `refine` and `convert` write it, unless the flags
    /// below say otherwise; `-` is standard input. With poses of `refine` come the camera and the
    /// shape of the wall that it has found and written beside them.
    #[arg(
        id = "poses",
        long = "poses",
        default_value = "initial",
        value_name = "initial|truth|FILE",
        value_parser = input_file()
    )]
    name: PathBuf,
    /// Shape of the wall, as `refine` writes it [default: that beside the poses, or that of
    /// survey.toml].
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    shape: Option<PathBuf>,
    #[command(flatten)]
    reading: PoseReadingArguments,
}

/// Prints the warnings of a survey.
fn warned(survey: Survey, terminal: &Terminal) -> Survey {
    for warning in &survey.warnings {
        terminal.warn(warning);
    }
    survey
}

/// Opens a survey with the camera and the wall that `refine` has written beside some poses, if it
/// has, and then changed by `change`.
///
/// # Errors
/// Everything that can be wrong with the survey.
fn open_as_found(
    survey: &Path,
    poses: Option<&Path>,
    change: impl FnOnce(&mut SurveyFile),
) -> Result<Survey, Failure> {
    let mut taken = Ok(());
    let opened = Survey::open_with(survey, |file| {
        if let Some(poses) = poses {
            taken = take_over_found(file, poses);
        }
        change(file);
    });
    taken?;
    Ok(opened?)
}

/// Takes camera, wall and the treatment of unreadable frames from the survey.toml that `refine` has
/// written beside `poses`, or into the folder `poses`, if it has.
///
/// # Errors
/// A malformed file.
fn take_over_found(file: &mut SurveyFile, poses: &Path) -> Result<(), SurveyError> {
    let folder = if poses.is_dir() {
        Some(poses)
    } else {
        poses.parent()
    };
    let Some(folder) = folder else {
        return Ok(());
    };
    let beside = folder.join(SURVEY_FILE);
    if !(folder.join(REFINEMENT_FILE).is_file() && beside.is_file()) {
        return Ok(());
    }
    let mut found = Survey::read_file(&beside)?;
    for path in found.paths_mut() {
        *path = absolute(&folder.join(&*path));
    }
    file.camera = found.camera;
    file.tunnel = found.tunnel;
    // The poses are those of the frames that could be read.
    replace(&mut file.frames.skip_bad, found.frames.skip_bad);
    Ok(())
}

impl PosesArguments {
    /// Poses of a file that `refine` has written.
    pub fn from_file(file: &Path) -> Self {
        Self {
            name: file.to_owned(),
            shape: None,
            reading: PoseReadingArguments::default(),
        }
    }

    /// Opens a survey with the camera and the wall that belong to these poses.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey.
    pub fn open_survey(
        &self,
        survey: &Path,
        change: impl FnOnce(&mut SurveyFile),
    ) -> Result<Survey, Failure> {
        open_as_found(survey, self.file(), |file| {
            replace(
                &mut file.tunnel.shape_file,
                self.shape.as_deref().map(absolute),
            );
            change(file);
        })
    }

    /// The file, unless the poses are those of survey.toml.
    pub fn file(&self) -> Option<&Path> {
        let is_of_survey = [INITIAL, TRUTH]
            .iter()
            .any(|word| self.name == Path::new(word));
        (!is_of_survey).then_some(&*self.name)
    }

    /// Opens a survey and reads the chosen poses.
    ///
    /// A file replaces the survey's initial poses; the section poses of survey.toml does not apply
    /// to it.
    ///
    /// # Errors
    /// Everything that can be wrong with the survey; true poses that the survey does not have; a
    /// file that does not hold the frames' poses.
    pub fn open(
        &self,
        survey: &Path,
        terminal: &Terminal,
    ) -> Result<(Survey, Trajectory), Failure> {
        let opened = self.open_survey(survey, |file| {
            if let Some(path) = self.file() {
                file.poses = PosesSection {
                    as_built: Some(true),
                    is_complete: true,
                    ..PosesSection::of(absolute(path))
                };
            }
            self.reading.apply_to(file);
        })?;
        let survey = warned(opened, terminal);
        let poses = match (self.name == Path::new(TRUTH), &survey.truth) {
            (true, Some(truth)) => truth.clone(),
            (true, None) => {
                return Err(Failure::usage(
                    "--poses truth: the survey has no poses.truth; use --poses initial or a file",
                ));
            }
            (false, _) => survey.initial.clone(),
        };
        Ok((survey, poses))
    }
}
