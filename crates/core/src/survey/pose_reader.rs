//! Reading of a pose file to one pose per frame in the tunnel's frame.

use super::associate::{
    Associate, TIME_TOLERANCE_S, TimeAssociation, by_name, by_order, by_time, present_by_order,
};
use super::clock_slip::ClockSlip;
use super::error::SurveyError;
use super::file::FramesSection;
use super::frame_times;
use super::interpreted_poses::InterpretedPoses;
use super::keyframe_poses;
use super::missing_poses::{self, MissingPoses};
use super::pose_conflicts::{FrameConflict, frame_conflicts};
use super::pose_shift::shifted;
use super::poses_section::PosesSection;
use super::skipped_frame::SkippedFrame;
use super::unit_slip::{ClockReading, UnitSlip};
use crate::frames::FrameFile;
use std::borrow::Cow;
use std::path::Path;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::trajectory::{
    Convention, Pose, PoseFile, PoseFileOptions, PoseFormat, StampedPose, TimeUnit, Trajectory,
    read_camera_in_body, read_poses_with, read_tunnel_frame,
};

/// The frames that poses are read for.
#[derive(Clone, Copy)]
pub(super) struct FramesToPose<'a> {
    /// The frames; of a rig, those of its first camera, one a moment.
    pub frames: &'a [FrameFile],
    /// The pictures of all cameras.
    pub pictures: &'a [FrameFile],
    /// Frames that are left out, and whose poses may be in a file.
    pub skipped: &'a [SkippedFrame],
    /// Times of the frames, seconds, if given by a file or a video.
    pub times_s: Option<&'a [f64]>,
    /// The section of the frames, which tells how to read their times.
    pub section: &'a FramesSection,
    /// The name of the camera, if one is selected.
    pub camera: Option<&'a str>,
}

/// A reader of pose files with the options of a [`PosesSection`].
pub(super) struct PoseReader<'a> {
    section: &'a PosesSection,
    folder: &'a Path,
    camera_in_body: Option<Pose>,
    tunnel_in_world: Option<Pose>,
    frames: FramesToPose<'a>,
}

impl<'a> PoseReader<'a> {
    /// Reads the files that the section names, relative to `folder`.
    ///
    /// # Errors
    /// A mount or a tunnel's frame that cannot be read.
    pub fn new(
        section: &'a PosesSection,
        folder: &'a Path,
        frames: &FramesToPose<'a>,
    ) -> Result<Self, SurveyError> {
        let mount = section.body_to_camera.as_ref();
        let tunnel = section.tunnel_frame.as_ref();
        Ok(Self {
            section,
            folder,
            camera_in_body: mount
                .map(|file| read_camera_in_body(&folder.join(file), frames.camera))
                .transpose()?,
            tunnel_in_world: tunnel
                .map(|file| read_tunnel_frame(&folder.join(file)))
                .transpose()?,
            frames: *frames,
        })
    }

    /// Reads a file of poses and associates them with the frames; `missing`: what becomes of frames
    /// that a file with names leaves out.
    ///
    /// # Errors
    /// A malformed file; poses of a body without its mount; frames and poses that cannot be
    /// associated; frames whose times do not increase. A file that has a pose for every picture of
    /// a rig, by their number or by their names, has those of its cameras.
    pub fn read(
        &self,
        path: &Path,
        missing: MissingPoses,
    ) -> Result<InterpretedPoses, SurveyError> {
        let is_rig = self.frames.pictures.len() > self.frames.frames.len();
        let options = self.section.file_options(is_rig);
        let file = read_poses_with(path, &options)?.later(self.section.time_offset_s);
        let convention = self.convention(&file);
        if file.format == PoseFormat::Euroc && convention.camera_in_body.is_none() && !is_rig {
            return Err(SurveyError::Association {
                path: file.path,
                what: "holds the poses of a body (IMU), as EuRoC's files do; say how the camera \
                       is mounted with \
                       --body-to-camera FILE (poses.body_to_camera in survey.toml): its \
                       sensor.yaml, or a 4 × 4 matrix"
                    .to_owned(),
            });
        }
        let FramesToPose {
            frames,
            pictures,
            skipped,
            times_s,
            ..
        } = self.frames;
        let default = match file.format {
            PoseFormat::Recording => Associate::Time,
            _ if file.has_names() && !are_counters(&file, frames) => Associate::Name,
            _ => Associate::Order,
        };
        let (mut gaps, mut conflicts) = (Vec::new(), Vec::new());
        let associate = self.section.associate.unwrap_or(default);
        let of_pictures = match is_rig {
            true => poses_of_pictures(&file, pictures, associate)?,
            false => None,
        };
        let is_of_pictures = of_pictures.is_some();
        let given = match associate {
            Associate::Order | Associate::Name if is_of_pictures => of_pictures.unwrap_or_default(),
            Associate::Order => by_order(&file, frames, skipped, times_s)?,
            Associate::Name => {
                let named = by_name(&file, frames, times_s)?;
                let first = file.entries.first().and_then(|entry| entry.name.as_deref());
                let named = (named.as_slice(), first);
                let (given, left_out) =
                    missing_poses::complete(&file.path, frames, times_s, named, missing)?;
                gaps = left_out;
                given
            }
            Associate::Time => {
                let times_s = self.frame_times_for(&file)?;
                let timed = self.associate_by_time(&file, &times_s, missing)?;
                conflicts = self.conflicts(&file, &times_s);
                let timed = (timed.as_slice(), None);
                let (given, left_out) =
                    missing_poses::complete(&file.path, frames, Some(&times_s), timed, missing)?;
                gaps = left_out;
                given
            }
        };
        // Pictures of a moment have one time.
        let moments = given
            .iter()
            .step_by(given.len().div_ceil(frames.len()).max(1));
        let pairs = moments.clone().zip(moments.skip(1));
        for ((before, stamped), frame) in pairs.zip(frames.iter().skip(1)) {
            if stamped.time_s <= before.time_s {
                return Err(SurveyError::Association {
                    path: file.path,
                    what: format!(
                        "frame {} ({}) has time {} s, and the one before it {} s; frames are \
                         sorted by their names, which must be the order of their times",
                        frame.index,
                        printed(&frame.path),
                        stamped.time_s,
                        before.time_s
                    ),
                });
            }
        }
        let read = InterpretedPoses {
            given,
            of_pictures: is_of_pictures,
            convention,
            format: file.format,
            gaps,
            conflicts,
        };
        let read = match self.section.unit_m {
            Some(unit_m) => read.in_unit(unit_m),
            None => read,
        };
        let read = match self.section.reversed {
            Some(true) => read.reversed(),
            _ => read,
        };
        match self.section.shift_frames {
            Some(shift_frames) => shifted(read, shift_frames, path, frames),
            None => Ok(read),
        }
    }

    /// The convention of a file of poses.
    fn convention(&self, file: &PoseFile) -> Convention {
        let convention = Convention::of(file.format);
        Convention {
            direction: self.section.convention.unwrap_or(convention.direction),
            axes: self.section.camera_axes.unwrap_or(convention.axes),
            camera_in_body: self.camera_in_body,
            tunnel_in_world: self.tunnel_in_world,
        }
    }

    /// Reads the poses of frames from a file that may not have all of them yet, in the tunnel's
    /// frame. By order, poses belong to the frames' indices.
    ///
    /// # Errors
    /// A malformed file; a file without names, times or frames' times by which poses are to be
    /// associated.
    pub fn read_present(&self, path: &Path) -> Result<Vec<Option<StampedPose>>, SurveyError> {
        let file = read_poses_with(path, &self.section.file_options(false))?
            .later(self.section.time_offset_s);
        let convention = self.convention(&file);
        let frames = self.frames.frames;
        let default = match file.has_names() {
            true => Associate::Name,
            false => Associate::Order,
        };
        let given = match self.section.associate().unwrap_or(default) {
            Associate::Order => present_by_order(&file, frames),
            Associate::Name => by_name(&file, frames, None)?,
            Associate::Time => self.present_by_time(&file)?,
        };
        let unit_m = self.section.unit_m.unwrap_or(1.0);
        let in_tunnel = |stamped: StampedPose| {
            let Pose { r_wc, t_wc } = stamped.pose;
            StampedPose {
                time_s: stamped.time_s,
                pose: convention.to_tunnel(&Pose::new(r_wc, unit_m * t_wc)),
            }
        };
        let given = given.into_iter();
        Ok(given.map(|stamped| stamped.map(in_tunnel)).collect())
    }

    /// Associates the poses that a file has with frames by their times.
    fn present_by_time(&self, file: &PoseFile) -> Result<Vec<Option<StampedPose>>, SurveyError> {
        let how = self.time_association();
        let times_s = self.frame_times()?;
        Ok(keyframe_poses::present(
            file,
            self.frames.frames,
            &times_s,
            how,
        ))
    }

    /// The parameters of the association by time.
    fn time_association(&self) -> TimeAssociation {
        TimeAssociation {
            tolerance_s: self.section.time_tolerance_s.unwrap_or(TIME_TOLERANCE_S),
            interpolate: self.section.interpolate.unwrap_or(false),
        }
    }

    /// Associates the poses of a file by the times of the frames. Where they do not fit, but do in
    /// other units, the error names these. At least half of the frames have a pose, if `missing`
    /// ones start between their neighbours, else all.
    fn associate_by_time(
        &self,
        file: &PoseFile,
        times_s: &[f64],
        missing: MissingPoses,
    ) -> Result<Vec<Option<StampedPose>>, SurveyError> {
        let (frames, how) = (self.frames.frames, self.time_association());
        let error = match by_time(file, frames, times_s, how) {
            Ok(all) => return Ok(all.into_iter().map(Some).collect()),
            Err(error) => error,
        };
        if let Some(slip) = self.time_slip(file, Some(times_s)) {
            return Err(slip);
        }
        let present = keyframe_poses::present(file, frames, times_s, how);
        let known = present.iter().flatten().count();
        let may_miss = missing == MissingPoses::Interpolate && !how.interpolate;
        if may_miss && missing_poses::are_enough(known, frames.len()) {
            Ok(present)
        } else {
            Err(keyframe_poses::with_remedy(error, file, frames, times_s))
        }
    }

    /// The contradictions of a file of poses that are associated by time.
    fn conflicts(&self, file: &PoseFile, times_s: &[f64]) -> Vec<FrameConflict> {
        let unit_m = self.section.unit_m.unwrap_or(1.0);
        frame_conflicts(file, times_s, self.time_association(), unit_m)
    }
}

impl PoseReader<'_> {
    /// The times of the frames as their section says.
    fn frame_times(&self) -> Result<Cow<'_, [f64]>, SurveyError> {
        match self.frames.times_s {
            Some(times_s) => Ok(Cow::Borrowed(times_s)),
            None => {
                let unit = self.frames.section.time_unit;
                frame_times::from_pictures(self.frames.frames, unit).map(Cow::Owned)
            }
        }
    }

    /// The times of the frames for the association with the poses of a file; where they have none,
    /// but do in another unit that fits, the error names that.
    fn frame_times_for(&self, file: &PoseFile) -> Result<Cow<'_, [f64]>, SurveyError> {
        self.frame_times()
            .map_err(|error| self.time_slip(file, None).unwrap_or(error))
    }

    /// The error that names a slip of times, if without it they fit: clocks that differ by a usual
    /// offset, or other units. `times_s`: the times of the frames, if they have some.
    fn time_slip(&self, file: &PoseFile, times_s: Option<&[f64]>) -> Option<SurveyError> {
        let how = self.time_association();
        let clock = times_s
            .and_then(|times_s| ClockSlip::find(file, self.frames.frames, times_s, how))
            .map(|found| found.sentence(self.section.time_offset_s));
        let unit = || self.unit_slip(file, times_s).map(|slip| slip.to_string());
        Some(SurveyError::Association {
            path: file.path.clone(),
            what: clock.or_else(unit)?,
        })
    }

    /// Other units in which the times of the poses and those of the frames fit each other.
    fn unit_slip(&self, file: &PoseFile, times_s: Option<&[f64]>) -> Option<UnitSlip> {
        let FramesToPose {
            frames, section, ..
        } = self.frames;
        let poses_in = |unit: TimeUnit| {
            let options = PoseFileOptions {
                time_unit: Some(unit),
                ..self.section.file_options(false)
            };
            read_poses_with(&file.path, &options).ok()
        };
        let frames_in = |unit: TimeUnit| match (&section.times, self.frames.times_s) {
            (Some(times), _) => {
                frame_times::read(&self.folder.join(times), frames, Some(unit)).ok()
            }
            (None, None) => frame_times::from_pictures(frames, Some(unit)).ok(),
            // A video or a recording has seconds.
            (None, Some(_)) => None,
        };
        let as_given = ClockReading {
            poses: Some(file.clone()),
            frames: times_s.map(<[f64]>::to_vec),
        };
        let how = self.time_association();
        UnitSlip::find(as_given, frames, how, poses_in, frames_in)
    }
}

/// True if the names of a file number the frames from 0 or 1, and are not those of pictures.
fn are_counters(file: &PoseFile, frames: &[FrameFile]) -> bool {
    let names = file.entries.iter().map(|entry| entry.name.as_deref());
    let numbers = names.map(|name| {
        let name = name?;
        // Tables of numbers alone write `3.0`.
        name.strip_suffix(".0")
            .unwrap_or(name)
            .parse::<usize>()
            .ok()
    });
    let Some(numbers) = numbers.collect::<Option<Vec<usize>>>() else {
        return false;
    };
    let counts = |start: usize| numbers.iter().copied().eq(start..start + frames.len());
    let is_name = |frame: &FrameFile| {
        let stem = frame.path.file_stem().unwrap_or_default().to_string_lossy();
        let mut names = file.entries.iter().map(|entry| entry.name.as_deref());
        names.any(|name| name == Some(&*stem))
    };
    (counts(0) || counts(1)) && !frames.iter().take(1).any(is_name)
}

/// The poses of all pictures of a rig, if the file has as many, or names them all.
fn poses_of_pictures(
    file: &PoseFile,
    pictures: &[FrameFile],
    associate: Associate,
) -> Result<Option<Trajectory>, SurveyError> {
    if file.entries.len() < pictures.len() {
        return Ok(None);
    }
    match associate {
        Associate::Order => Ok((file.entries.len() == pictures.len()).then(|| file.trajectory())),
        Associate::Name => Ok(by_name(file, pictures, None)?.into_iter().collect()),
        Associate::Time => Ok(None),
    }
}
