//! Poses of a file that contradict each other.

use super::pose_entry::PoseEntry;

/// Largest distance of two poses of one time that agree, units of the file.
const MAX_DISTANCE: f64 = 1e-3;
/// Largest angle between two poses of one time that agree, degrees.
const MAX_ANGLE_DEG: f64 = 0.01;

/// Two poses of one time that do not agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseConflict {
    /// Index of the pose that is kept, the first of the two.
    pub entry: usize,
    /// Their time, seconds.
    pub time_s: f64,
    /// 1-based numbers of their lines.
    pub lines: [usize; 2],
    /// Distance between their positions, units of the file.
    pub distance: f64,
    /// Angle between their rotations, degrees.
    pub angle_deg: f64,
}

impl PoseConflict {
    /// The conflict between the pose `entry` and another of its time; `None` if they agree within
    /// 1 mm (of metres) and 0.01°.
    pub(super) fn between(
        entry: usize,
        [first, second]: [&PoseEntry; 2],
        lines: [usize; 2],
        time_s: f64,
    ) -> Option<Self> {
        let distance = (first.pose.t_wc - second.pose.t_wc).norm();
        let angle_deg = first.pose.r_wc.angle_to(&second.pose.r_wc).to_degrees();
        let is_conflict = !(distance <= MAX_DISTANCE && angle_deg <= MAX_ANGLE_DEG);
        is_conflict.then_some(Self {
            entry,
            time_s,
            lines,
            distance,
            angle_deg,
        })
    }
}
