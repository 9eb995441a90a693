//! Poses that were read from a file, one per frame, and readings of them.

use super::missing_poses::PoseGap;
use super::pose_conflicts::FrameConflict;
use tunnelstitch_geometry::trajectory::{
    Convention, Pose, PoseFormat, Rig, StampedPose, Trajectory, poses_of,
};

/// The poses of a file, one per frame, with their convention.
#[derive(Clone)]
pub(super) struct InterpretedPoses {
    /// The poses in the file's convention.
    pub given: Trajectory,
    /// True if they are of all pictures of a rig, moment by moment, instead of its body.
    pub of_pictures: bool,
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

    /// The poses of camera `camera` of a rig, one a moment.
    pub fn of_camera(&self, camera: usize, rig: &Rig) -> Self {
        if self.of_pictures {
            let own = self.given.iter().skip(camera).step_by(rig.cameras());
            return Self {
                given: own.copied().collect(),
                of_pictures: false,
                ..self.clone()
            };
        }
        Self {
            convention: Convention {
                camera_in_body: Some(rig.mounts()[camera]),
                ..self.convention
            },
            ..self.clone()
        }
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
            of_pictures: self.of_pictures,
            convention: self.convention,
            format: self.format,
            gaps: self.gaps.clone(),
            conflicts: self.conflicts.clone(),
        }
    }
}
