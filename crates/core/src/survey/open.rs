//! Opening and validation of surveys.

use super::associate::TIME_TOLERANCE_S;
use super::error::SurveyError;
use super::file::read_survey_file;
use super::file::{SURVEY_FILE, SurveyFile};
use super::masked_wall::MaskedWall;
use super::missing_poses::{self, MissingPoses, PoseGap};
use super::pose_conflicts;
use super::pose_reader::{FramesToPose, PoseReader};
use super::poses_section::PosesSection;
use super::readout::readout_warning;
use super::shape_file::ShapeFile;
use super::skipped_frame::{self, SkippedFrame};
use super::taken_frames::{SurveyPlace, TakenFrames};
use super::{ignore, pose_validation};
use crate::frames::{FrameFile, FrameSet, Video};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::surface::{Bend, RadialField, Surface, WallRegions, bent, displaced};
use tunnelstitch_geometry::trajectory::{
    Jitter, MAX_SEARCH_VOLUME_DEG3, Pose, PoseError, Rig, Shutter, StampedPose, Trajectory,
    poses_of, read_tunnel_frame,
};

/// A survey, read and validated, except the pixels.
#[derive(Debug)]
pub struct Survey {
    /// The folder of `survey.toml`.
    pub folder: PathBuf,
    /// The content of `survey.toml`.
    pub file: SurveyFile,
    /// The cameras.
    pub cameras: Cameras,
    /// The relation of the cameras, if there are several.
    pub rig: Option<Rig>,
    /// The tunnel.
    pub surface: Arc<dyn Surface>,
    /// The tunnel without the displacement of `shape_file`, but with its bend.
    pub nominal: Arc<dyn Surface>,
    /// The bend of the tunnel that `shape_file` has.
    pub bend: Option<Bend>,
    /// The displacement of the wall that `shape_file` has.
    pub displacement: Option<RadialField>,
    /// 1-σ of the wall's deviation from the given shape, metres.
    pub shape_sigma_m: f64,
    /// Relative 1-σ of the tunnel's radius; 0 if it is exact.
    pub radius_sigma: f64,
    /// Regions of the wall that are excluded from the comparison of frames.
    pub ignored: WallRegions,
    /// The frames, sorted by name, with their masks; those of a rig moment by moment.
    pub frames: FrameSet,
    /// The frames that are left out because they cannot be read (`frames.skip_bad`).
    pub skipped: Vec<SkippedFrame>,
    /// The initial poses, one per frame.
    pub initial: Trajectory,
    /// Length of a unit of the initial poses as it is taken, metres, if they are of a program
    /// whose models have no scale of their own.
    pub unscaled_unit_m: Option<f64>,
    /// The frames that the file of the initial poses leaves out, and whose initial poses are
    /// interpolated.
    pub pose_gaps: Vec<PoseGap>,
    /// The true poses, one per frame, if known.
    pub truth: Option<Trajectory>,
    /// Noise model of the initial poses.
    pub prior: Jitter,
    /// Warnings about suspicious data, with a probable cause.
    pub warnings: Vec<String>,
    /// The frames' times, for a rig those of the moments, seconds, if given by a file or a video.
    pub(super) times_s: Option<Vec<f64>>,
    /// The frames of the first camera of a rig; empty for a single camera.
    moments: Vec<FrameFile>,
    /// See [`Survey::own_files`].
    own_files: Vec<PathBuf>,
}

/// Poses of a file in the tunnel's frame, one per frame.
#[derive(Default)]
pub(super) struct ReadPoses {
    /// The poses.
    pub trajectory: Trajectory,
    /// True if the file's program has models without a scale of their own.
    pub has_no_scale: bool,
    /// The frames that the file leaves out.
    pub gaps: Vec<PoseGap>,
    /// Warnings about suspicious poses.
    pub warnings: Vec<String>,
}

impl Survey {
    /// Reads a survey: `path` is its folder or its `survey.toml`.
    ///
    /// # Errors
    /// All errors that can be detected before a pixel is read; see [`SurveyError`].
    pub fn open(path: &Path) -> Result<Self, SurveyError> {
        Self::open_with(path, |_| ())
    }

    /// Reads only survey.toml (or the one in the folder `path`).
    ///
    /// # Errors
    /// A missing or malformed file.
    pub fn read_file(path: &Path) -> Result<SurveyFile, SurveyError> {
        read_survey_file(&toml_path(path))
    }

    /// Opens a survey with modified content of its `survey.toml`.
    ///
    /// # Errors
    /// The errors of [`Survey::open`].
    pub fn open_with(
        path: &Path,
        change: impl FnOnce(&mut SurveyFile),
    ) -> Result<Self, SurveyError> {
        let toml_path = toml_path(path);
        let mut file = read_survey_file(&toml_path)?;
        let folder = folder_of(&toml_path);
        let mut own_files = vec![toml_path.clone()];
        own_files.extend(file.paths_mut().map(|path| folder.join(&*path)));
        change(&mut file);
        own_files.extend(file.paths_mut().map(|path| folder.join(&*path)));
        let value = |what: String| SurveyError::Value {
            path: toml_path.clone(),
            what,
        };
        let planned = file.tunnel.surface(&toml_path, &folder)?;
        let shape_sigma_m = file.tunnel.shape_sigma_m().map_err(value)?;
        let radius_sigma = file.tunnel.radius_sigma().map_err(value)?;
        let found = file.tunnel.found_shape(planned.as_ref(), &folder)?;
        let bend = found.as_ref().and_then(|found| found.bend);
        let nominal = bent(&planned, bend);
        let displacement = found.and_then(|found| found.displacement());
        let surface = displaced(&nominal, displacement.clone());
        check_values(&file).map_err(value)?;
        let place = SurveyPlace {
            file: &file,
            toml_path: &toml_path,
            folder: &folder,
        };
        let TakenFrames {
            cameras,
            frames,
            rig,
            moments,
            skipped,
            times_s,
            video,
            bits,
            warnings: picture_warnings,
        } = place.take_frames(surface.as_ref())?;
        file.frames.bits = bits.or(file.frames.bits);
        if let Some(video) = &video {
            check_displayed_rows(video, &file).map_err(value)?;
        }
        let ignored = ignore::wall_regions(&file.tunnel.ignore, surface.as_ref()).map_err(value)?;
        let mut survey = Self {
            cameras,
            rig,
            surface,
            nominal,
            bend,
            displacement,
            shape_sigma_m,
            radius_sigma,
            ignored,
            frames,
            skipped,
            initial: Vec::new(),
            unscaled_unit_m: None,
            pose_gaps: Vec::new(),
            truth: None,
            prior: file.prior.into(),
            warnings: Vec::new(),
            times_s,
            moments,
            own_files,
            folder,
            file,
        };
        if let Some(step_deg) = survey.file.frames.angle_step_deg {
            survey.select_keyframes(step_deg, &toml_path, planned.as_ref())?;
        }
        let read = survey.read_initial(planned.as_ref());
        let mut read = read.map_err(|error| survey.without_initial_poses(error))?;
        let initial = std::mem::take(&mut read.trajectory);
        let mut warnings = std::mem::take(&mut read.warnings);
        let truth = survey.read_truth()?;
        let truth = truth.map(|read| {
            warnings.extend(read.warnings);
            read.trajectory
        });
        for section in survey.file.camera.all() {
            warnings.extend(readout_warning(section, &survey.folder));
        }
        warnings.extend(survey.file.tunnel.size_warning());
        warnings.extend(picture_warnings);
        warnings.extend(survey.skipped_sentence());
        warnings.extend(
            video
                .iter()
                .filter_map(|video| video.warning().map(str::to_owned)),
        );
        (survey.initial, survey.truth, survey.warnings) = (initial, truth, warnings);
        survey.pose_gaps = read.gaps;
        let unit_m = survey.file.poses.unit_m.unwrap_or(1.0);
        survey.unscaled_unit_m = read.has_no_scale.then_some(unit_m);
        survey.validate_readout().map_err(value)?;
        Ok(survey)
    }

    /// The error of reading the initial poses, if their file is not there in other words.
    fn without_initial_poses(&self, error: SurveyError) -> SurveyError {
        let path = self.folder.join(&self.file.poses.initial);
        match error {
            SurveyError::Poses(PoseError::Read { source, .. })
                if source.kind() == std::io::ErrorKind::NotFound && !path.exists() =>
            {
                SurveyError::NoInitialPoses { path }
            }
            other => other,
        }
    }

    /// Reads the initial poses, in the tunnel `planned` or as it was built; none where they are
    /// awaited.
    fn read_initial(&self, planned: &dyn Surface) -> Result<ReadPoses, SurveyError> {
        let section = &self.file.poses;
        if section.is_awaited {
            return Ok(ReadPoses::default());
        }
        let path = self.folder.join(&section.initial);
        let missing = section.missing_poses();
        if section.as_built == Some(true) {
            return self.read_as(section, &path, self.surface.as_ref(), missing);
        }
        let read = self.read_as(section, &path, planned, missing)?;
        Ok(ReadPoses {
            trajectory: self.carried(read.trajectory),
            ..read
        })
    }

    /// Reads the true poses, if there are any and none are awaited.
    fn read_truth(&self) -> Result<Option<ReadPoses>, SurveyError> {
        let section = &self.file.poses;
        let Some(truth) = section.truth.as_ref().filter(|_| !section.is_awaited) else {
            return Ok(None);
        };
        let section = PosesSection {
            shift_frames: None,
            ..section.clone()
        };
        let (path, surface) = (self.folder.join(truth), self.surface.as_ref());
        let read = self.read_as(&section, &path, surface, MissingPoses::Refuse)?;
        Ok(Some(read))
    }

    /// Reads a file of poses in the tunnel, as `refine` and `convert` write them, in its format's
    /// own convention, and checks it against the frames and the tunnel.
    ///
    /// # Errors
    /// A malformed file, poses that cannot be associated with the frames, a camera outside the
    /// tunnel.
    pub fn read_poses(&self, path: &Path) -> Result<Trajectory, SurveyError> {
        let surface = self.surface.as_ref();
        let section = PosesSection::of(path);
        let read = self.read_as(&section, path, surface, MissingPoses::Refuse)?;
        Ok(read.trajectory)
    }

    /// Initial poses carried along with the bend of the tunnel: they are those of the tunnel as
    /// planned.
    pub(super) fn carried(&self, initial: Trajectory) -> Trajectory {
        let carry = |stamped: StampedPose| match &self.bend {
            Some(bend) => StampedPose {
                pose: bend.bent(&stamped.pose),
                ..stamped
            },
            None => stamped,
        };
        initial.into_iter().map(carry).collect()
    }

    /// Reads a file of poses in the tunnel `surface` with the options of a section.
    pub(super) fn read_as(
        &self,
        section: &PosesSection,
        path: &Path,
        surface: &dyn Surface,
        missing: MissingPoses,
    ) -> Result<ReadPoses, SurveyError> {
        let to_pose = self.frames_to_pose();
        let reader = PoseReader::new(section, &self.folder, &to_pose)?;
        // A moment of a rig without a pose has none of any camera.
        let missing = match self.rig {
            Some(_) => MissingPoses::Refuse,
            None => missing,
        };
        let reading = reader.read(path, missing)?;
        let cameras = self.cameras.all().iter().enumerate();
        let (mut warnings, mut of_cameras) = (Vec::new(), Vec::new());
        for (k, camera) in cameras {
            let own = match &self.rig {
                Some(rig) => reading.of_camera(k, rig),
                None => reading.clone(),
            };
            let trajectory = own.trajectory();
            let poses = poses_of(&trajectory);
            let has_own_axes = section.camera_axes.is_some();
            let validated =
                pose_validation::validate_poses(surface, camera, &own, &poses, path, has_own_axes);
            let of_camera = validated.map_err(|error| self.of_frame_of_camera(k, error))?;
            warnings.extend(of_camera);
            of_cameras.push(trajectory);
        }
        warnings.extend(missing_poses::warning(path, &self.frames, &reading.gaps));
        let conflicts = &reading.conflicts;
        let in_conflict = pose_conflicts::check(path, to_pose.frames, conflicts, &self.prior)?;
        warnings.extend(in_conflict);
        Ok(ReadPoses {
            trajectory: in_turn(&of_cameras),
            has_no_scale: reading.format.has_no_scale(),
            gaps: reading.gaps,
            warnings,
        })
    }

    /// An error of a camera's poses, which are one a moment, of the survey's frames.
    fn of_frame_of_camera(&self, camera: usize, error: SurveyError) -> SurveyError {
        match error {
            SurveyError::Placement {
                path,
                frame,
                source,
                remedy,
            } => SurveyError::Placement {
                path,
                frame: frame * self.cameras.count() + camera,
                source,
                remedy,
            },
            other => other,
        }
    }

    /// A sentence that names the frames that are left out because they cannot be read, if there are
    /// any.
    pub fn skipped_sentence(&self) -> Option<String> {
        skipped_frame::sentence(&self.skipped, self.frames.len())
    }

    /// The frames that poses are read for.
    pub(super) fn frames_to_pose(&self) -> FramesToPose<'_> {
        FramesToPose {
            frames: if self.rig.is_some() {
                &self.moments
            } else {
                &self.frames
            },
            pictures: &self.frames,
            skipped: &self.skipped,
            times_s: self.times_s.as_deref(),
            section: &self.file.frames,
            camera: self.file.camera.first().name.as_deref(),
        }
    }

    /// The files of the survey except the frames, even if others were read in their place.
    pub fn own_files(&self) -> &[PathBuf] {
        &self.own_files
    }

    /// Checks the readout time: it cannot be longer than the time between frames.
    fn validate_readout(&self) -> Result<(), String> {
        let Some(readout_ms) = self.file.camera.first().readout_ms else {
            return Ok(());
        };
        let steps = self
            .initial
            .windows(2)
            .map(|pair| pair[1].time_s - pair[0].time_s);
        let shortest_ms = 1e3 * steps.fold(f64::INFINITY, f64::min);
        let possible = readout_ms.is_finite() && readout_ms.abs() <= shortest_ms;
        if possible {
            Ok(())
        } else {
            Err(format!(
                "camera.readout_ms is {readout_ms}; it must be a number of milliseconds and no \
                 more than the {shortest_ms:.3} ms between \
                 the times of the nearest two poses in {}",
                printed(&self.file.poses.initial)
            ))
        }
    }

    /// The readout times of the frames' rows, from the times of the initial poses; rigs have a
    /// global shutter.
    pub fn shutter(&self) -> Shutter {
        if self.rig.is_some() {
            return Shutter::default();
        }
        let readout_ms = self.file.camera.first().readout_ms;
        let readout_s = 1e-3 * readout_ms.unwrap_or_default();
        Shutter::new(readout_s, self.cameras.size()[1], &self.initial)
    }

    /// Reads the file of the wall's displacement, with its uncertainty; None if the wall has none.
    ///
    /// # Errors
    /// A file that has become unreadable since the survey was opened.
    pub fn shape_file(&self) -> Result<Option<ShapeFile>, SurveyError> {
        let file = self.file.tunnel.shape_file.as_ref();
        let read =
            |file: &PathBuf| ShapeFile::read(&self.folder.join(file), self.nominal.perimeter_m());
        file.map(read).transpose()
    }

    /// Reads the file beside the shape file of the wall that was left out when the shape was
    /// estimated; None if there is none.
    ///
    /// # Errors
    /// A malformed file, or one of another tunnel.
    pub fn masked_wall(&self) -> Result<Option<MaskedWall>, SurveyError> {
        let shape_file = self.file.tunnel.shape_file.as_ref();
        shape_file.map_or(Ok(None), |file| {
            MaskedWall::read_beside(&self.folder.join(file), self.nominal.perimeter_m())
        })
    }

    /// Reads the tunnel's frame in the world of the initial poses; None if they are the same.
    ///
    /// # Errors
    /// A file that has become unreadable since the survey was opened.
    pub fn tunnel_in_world(&self) -> Result<Option<Pose>, SurveyError> {
        let file = self.file.poses.tunnel_frame.as_ref();
        let read = |file: &PathBuf| read_tunnel_frame(&self.folder.join(file));
        Ok(file.map(read).transpose()?)
    }

    /// The initial poses without their times.
    pub fn initial_poses(&self) -> Vec<Pose> {
        poses_of(&self.initial)
    }
}

/// The poses of several cameras in turn, moment by moment.
fn in_turn(of_cameras: &[Trajectory]) -> Trajectory {
    let moments = of_cameras.iter().map(Vec::len).min().unwrap_or_default();
    let of_moment = |k: usize| of_cameras.iter().map(move |poses| poses[k]);
    (0..moments).flat_map(of_moment).collect()
}

/// The folder that the paths in `survey.toml` are relative to.
pub(super) fn folder_of(toml_path: &Path) -> PathBuf {
    match toml_path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// The path of `survey.toml` for a folder or for the file itself.
pub fn toml_path(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join(SURVEY_FILE)
    } else {
        path.to_owned()
    }
}

/// Checks that the rows of a rolling shutter are rows of the displayed pictures.
fn check_displayed_rows(video: &Video, file: &SurveyFile) -> Result<(), String> {
    if video.rotation_deg() == 0 || file.camera.first().readout_ms.is_none() {
        return Ok(());
    }
    Err(format!(
        "camera.readout_ms goes from row to row, but {} is displayed with a rotation of {}°, so \
         that its rows are not the rows that the sensor reads at once; extract the pictures with \
         ffmpeg -noautorotate and calibrate for these, or remove readout_ms",
        printed(video.path()),
        video.rotation_deg()
    ))
}

/// Checks the numbers of a survey's file that stand for themselves; returns what is wrong.
fn check_values(file: &SurveyFile) -> Result<(), String> {
    let prior = &file.prior;
    if !(1e-6..=180.0).contains(&prior.rotation_sigma_deg) {
        return Err(format!(
            "prior.rotation_sigma_deg is {}; it must lie between 1e-6 and 180",
            prior.rotation_sigma_deg
        ));
    }
    if !prior
        .translation_sigma_m
        .iter()
        .all(|s| (1e-9..=10.0 * file.tunnel.nominal_m()).contains(s))
    {
        return Err(format!(
            "prior.translation_sigma_m is {:?}; all three must lie between 1e-9 and ten times \
             the radius (half the width)",
            prior.translation_sigma_m
        ));
    }
    let radius_m = file.tunnel.nominal_m();
    let volume_deg3 = Jitter::from(*prior).search_volume_deg3(radius_m);
    if volume_deg3 > MAX_SEARCH_VOLUME_DEG3 {
        return Err(format!(
            "prior: rotation_sigma_deg = {} and translation_sigma_m = {:?} are too wide to search \
             for every frame ({volume_deg3:.0} cubic degrees as seen in the picture, at most \
             {MAX_SEARCH_VOLUME_DEG3:.0}, as for 20° about each axis); give better poses \
             (tunnelstitch plan or gyro write some) and sigmas as small as their errors",
            prior.rotation_sigma_deg, prior.translation_sigma_m
        ));
    }
    let ranges = file.camera.all().iter();
    let mut ranges = ranges.filter_map(|camera| camera.max_range_m);
    if let Some(max_range_m) = ranges.find(|m| !(radius_m..=1e3 * radius_m).contains(m)) {
        return Err(format!(
            "camera.max_range_m is {max_range_m}; it must be metres, between the radius (half the \
             width) and a thousand times that"
        ));
    }
    if let Some(calibrate) = &file.calibrate {
        calibrate.validate()?;
    }
    let tolerance_s = file.poses.time_tolerance_s.unwrap_or(TIME_TOLERANCE_S);
    if !(0.0..=1e6).contains(&tolerance_s) {
        return Err(format!(
            "poses.time_tolerance_s is {tolerance_s}; it must be seconds, 0 or more"
        ));
    }
    if let Some(unit_m) = file.poses.unit_m
        && !(unit_m.is_finite() && unit_m > 0.0)
    {
        return Err(format!(
            "poses.unit_m is {unit_m}; it must be the length of a unit in metres, such as 0.001"
        ));
    }
    Ok(())
}
