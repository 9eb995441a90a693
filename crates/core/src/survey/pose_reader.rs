//! Reading of a pose file to one pose per frame in the tunnel's frame.

use super::associate::{Associate, TIME_TOLERANCE_S, TimeAssociation, by_name, by_order, by_time};
use super::error::SurveyError;
use super::frame_times;
use super::missing_poses::{self, MissingPoses, PoseGap};
use super::pose_conflicts::{FrameConflict, frame_conflicts};
use super::poses_section::PosesSection;
use super::skipped_frame::SkippedFrame;
use crate::frames::FrameFile;
use std::borrow::Cow;
use std::path::Path;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::trajectory::{
    Convention, Pose, PoseFile, PoseFormat, StampedPose, Trajectory, poses_of, read_camera_in_body,
    read_poses_with, read_tunnel_frame,
};

/// The frames that poses are read for.
#[derive(Clone, Copy)]
pub(super) struct FramesToPose<'a> {
    /// The frames.
    pub frames: &'a [FrameFile],
    /// Frames that are left out, and whose poses may be in a file.
    pub skipped: &'a [SkippedFrame],
    /// Times of the frames, seconds, if given by a file or a video.
    pub times_s: Option<&'a [f64]>,
}

/// A reader of pose files with the options of a [`PosesSection`].
pub(super) struct PoseReader<'a> {
    section: &'a PosesSection,
    camera_in_body: Option<Pose>,
    tunnel_in_world: Option<Pose>,
    frames: FramesToPose<'a>,
}

/// The poses of a file, one per frame, with their convention.
pub(super) struct InterpretedPoses {
    /// The poses in the file's convention.
    pub given: Trajectory,
    /// The convention.
    pub convention: Convention,
    /// The file's format.
    pub format: PoseFormat,
    /// The frames that the file leaves out.
    pub gaps: Vec<PoseGap>,
    /// Times that the file has twice with different poses.
    pub conflicts: Vec<FrameConflict>,
}

impl InterpretedPoses {
    /// The poses in the tunnel's frame.
    pub fn trajectory(&self) -> Trajectory {
        self.trajectory_in(&self.convention)
    }

    /// The poses in the tunnel's frame, interpreted in another convention.
    pub fn trajectory_in(&self, convention: &Convention) -> Trajectory {
        let in_tunnel = |stamped: &StampedPose| StampedPose {
            time_s: stamped.time_s,
            pose: convention.to_tunnel(&stamped.pose),
        };
        self.given.iter().map(in_tunnel).collect()
    }

    /// The poses in the tunnel's frame, interpreted in another convention, without their times.
    pub fn poses_in(&self, convention: &Convention) -> Vec<Pose> {
        poses_of(&self.trajectory_in(convention))
    }

    /// The file's poses with positions of another unit, metres.
    pub fn in_unit(&self, unit_m: f64) -> Self {
        self.changed(|pose| Pose::new(pose.r_wc, pose.t_wc * unit_m))
    }

    /// The file's poses in reverse order, at the times of the frames.
    pub fn reversed(&self) -> Self {
        self.with_poses(self.given.iter().rev().map(|stamped| stamped.pose))
    }

    /// The file's poses, each changed.
    pub fn changed(&self, change: impl Fn(&Pose) -> Pose) -> Self {
        self.with_poses(self.given.iter().map(|stamped| change(&stamped.pose)))
    }

    /// Other poses at the times of the frames.
    fn with_poses(&self, poses: impl Iterator<Item = Pose>) -> Self {
        let times_s = self.given.iter().map(|stamped| stamped.time_s);
        let stamped = times_s.zip(poses);
        Self {
            given: stamped
                .map(|(time_s, pose)| StampedPose { time_s, pose })
                .collect(),
            convention: self.convention,
            format: self.format,
            gaps: self.gaps.clone(),
            conflicts: self.conflicts.clone(),
        }
    }
}

impl<'a> PoseReader<'a> {
    /// Reads the files that the section names, relative to `folder`.
    ///
    /// # Errors
    /// A mount or a tunnel's frame that cannot be read.
    pub fn new(
        section: &'a PosesSection,
        folder: &Path,
        frames: &FramesToPose<'a>,
    ) -> Result<Self, SurveyError> {
        let mount = section.body_to_camera.as_ref();
        let tunnel = section.tunnel_frame.as_ref();
        Ok(Self {
            section,
            camera_in_body: mount
                .map(|file| read_camera_in_body(&folder.join(file)))
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
    /// associated; frames whose times do not increase.
    pub fn read(
        &self,
        path: &Path,
        missing: MissingPoses,
    ) -> Result<InterpretedPoses, SurveyError> {
        let file = read_poses_with(path, &self.section.file_options())?;
        let mut convention = Convention::of(file.format);
        convention.direction = self.section.convention.unwrap_or(convention.direction);
        convention.axes = self.section.camera_axes.unwrap_or(convention.axes);
        convention.camera_in_body = self.camera_in_body;
        convention.tunnel_in_world = self.tunnel_in_world;
        if file.format == PoseFormat::Euroc && convention.camera_in_body.is_none() {
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
            skipped,
            times_s,
        } = self.frames;
        let default = match file.format {
            PoseFormat::Recording => Associate::Time,
            _ if file.has_names() => Associate::Name,
            _ => Associate::Order,
        };
        let (mut gaps, mut conflicts) = (Vec::new(), Vec::new());
        let given = match self.section.associate.unwrap_or(default) {
            Associate::Order => by_order(&file, frames, skipped, times_s)?,
            Associate::Name => {
                let named = by_name(&file, frames, times_s)?;
                let (given, left_out) =
                    missing_poses::complete(&file.path, frames, times_s, &named, missing)?;
                gaps = left_out;
                given
            }
            Associate::Time => {
                let (given, contradictions) = self.associate_by_time(&file)?;
                conflicts = contradictions;
                given
            }
        };
        for (pair, frame) in given.windows(2).zip(frames.iter().skip(1)) {
            if let [before, stamped] = pair
                && stamped.time_s <= before.time_s
            {
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
            convention,
            format: file.format,
            gaps,
            conflicts,
        };
        let read = match self.section.unit_m {
            Some(unit_m) => read.in_unit(unit_m),
            None => read,
        };
        Ok(match self.section.reversed {
            Some(true) => read.reversed(),
            _ => read,
        })
    }

    /// Associates the poses of a file by the times of the frames, and names its contradictions.
    fn associate_by_time(
        &self,
        file: &PoseFile,
    ) -> Result<(Trajectory, Vec<FrameConflict>), SurveyError> {
        let how = TimeAssociation {
            tolerance_s: self.section.time_tolerance_s.unwrap_or(TIME_TOLERANCE_S),
            interpolate: self.section.interpolate.unwrap_or(false),
        };
        let frames = self.frames.frames;
        let times_s = match self.frames.times_s {
            Some(times_s) => Cow::Borrowed(times_s),
            None => Cow::Owned(frame_times::from_names(frames)?),
        };
        let given = by_time(file, frames, &times_s, how)?;
        let unit_m = self.section.unit_m.unwrap_or(1.0);
        Ok((given, frame_conflicts(file, &times_s, how, unit_m)))
    }
}
