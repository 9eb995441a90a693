//! Poses that fall to the origin amid others: of a tracker that has lost the camera, of an odometry
//! that begins again.

use super::interpreted_poses::InterpretedPoses;
use std::ops::Range;
use std::path::Path;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::trajectory::{Pose, StampedPose};

/// Most runs of frames that are named.
const MAX_NAMED_RUNS: usize = 3;

/// Frames in a row whose poses are at the origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LostPoses {
    frames: Range<usize>,
    /// True if the poses after them go on from the origin, not from the pose before them.
    begins_again: bool,
}

impl LostPoses {
    /// Finds poses of a file that are the identity, or equal to its first one, after others that
    /// are not. The step to or from them is longer than every step between other poses: a camera
    /// that stands still at the start, and a plan that comes back there, are right.
    pub fn find(reading: &InterpretedPoses) -> Vec<Self> {
        let given = &reading.given;
        let Some(first) = given.first() else {
            return Vec::new();
        };
        let is_interpolated = |k: usize| reading.gaps.iter().any(|gap| gap.frames.contains(&k));
        let is_origin = |k: usize| {
            let pose = &given[k].pose;
            !is_interpolated(k) && (*pose == Pose::identity() || *pose == first.pose)
        };
        let start = (0..given.len()).take_while(|k| is_origin(*k)).count();
        let mut runs: Vec<Range<usize>> = Vec::new();
        for k in (start..given.len()).filter(|k| is_origin(*k)) {
            match runs.last_mut() {
                Some(run) if run.end == k => run.end = k + 1,
                _ => runs.push(k..k + 1),
            }
        }
        let is_lost = |k: usize| runs.iter().any(|run| run.contains(&k));
        let longest_m = (1..given.len())
            .filter(|k| !is_lost(*k) && !is_lost(k - 1))
            .map(|k| distance_m(&given[k - 1], &given[k]))
            .fold(0.0, f64::max);
        let lost = runs.iter().filter_map(|run| {
            let before = &given[run.start.checked_sub(1)?];
            let origin = &given[run.start];
            let after = given.get(run.end);
            let onward_m = after.map(|after| distance_m(origin, after));
            let jump_m = distance_m(before, origin).max(onward_m.unwrap_or_default());
            let begins_again = (after.zip(onward_m))
                .is_some_and(|(after, onward_m)| onward_m < distance_m(before, after));
            (jump_m > longest_m).then(|| Self {
                frames: run.clone(),
                begins_again,
            })
        });
        lost.collect()
    }

    /// True if a frame has such a pose.
    pub fn contains(&self, frame: usize) -> bool {
        self.frames.contains(&frame)
    }

    /// The sentence about such poses of a file; None without any.
    pub fn sentence(lost: &[Self], path: &Path) -> Option<String> {
        let named = |lost: &Self| match lost.frames.len() {
            1 => format!("frame {}", lost.frames.start),
            _ => format!("frames {} to {}", lost.frames.start, lost.frames.end - 1),
        };
        let begins_again = lost.iter().any(|lost| lost.begins_again);
        let mut frames: Vec<String> = lost.iter().take(MAX_NAMED_RUNS).map(named).collect();
        if lost.len() > MAX_NAMED_RUNS {
            frames.push(format!("{} more", lost.len() - MAX_NAMED_RUNS));
        }
        let remedy = if begins_again {
            "an odometry that began again there goes on from the origin: append its poses to the \
             last one before (T_last · T), or make a survey of each part"
        } else {
            "a tracker writes this where it has lost the camera: leave these lines out of the \
             file if it names its frames, which then start between their neighbours; else leave \
             out these frames, too"
        };
        (!lost.is_empty()).then(|| {
            format!(
                "{}: poses fall back to the origin amid others, those of {}; {remedy}",
                printed(path),
                frames.join(", ")
            )
        })
    }
}

/// Distance of two positions, in the unit of the file.
fn distance_m(a: &StampedPose, b: &StampedPose) -> f64 {
    (a.pose.t_wc - b.pose.t_wc).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};
    use tunnelstitch_geometry::trajectory::{Convention, PoseFormat, indexed};

    /// Poses along y at these places, turned by 0.1 per frame but where they are at 0.
    fn found(places: &[f64]) -> Vec<LostPoses> {
        let pose = |(k, y): (usize, &f64)| {
            let angle = if *y == 0.0 { 0.0 } else { 0.1 * k as f64 };
            let r_wc = UnitQuaternion::from_scaled_axis(Vector3::y() * angle);
            Pose::new(r_wc, Vector3::y() * *y)
        };
        let reading = InterpretedPoses {
            given: indexed(places.iter().enumerate().map(pose)),
            of_pictures: false,
            convention: Convention::of(PoseFormat::Tum),
            format: PoseFormat::Tum,
            gaps: Vec::new(),
            conflicts: Vec::new(),
        };
        LostPoses::find(&reading)
    }

    fn lost(frames: Range<usize>, begins_again: bool) -> LostPoses {
        LostPoses {
            frames,
            begins_again,
        }
    }

    #[test]
    fn lost_cameras_and_odometries_that_begin_again_are_told() {
        assert_eq!(
            found(&[0.0, 1.0, 2.0, 0.0, 0.0, 5.0, 6.0]),
            [lost(3..5, false)]
        );
        assert_eq!(
            found(&[0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0]),
            [lost(4..5, true)]
        );
        assert_eq!(found(&[4.0, 5.0, 6.0, 0.0]), [lost(3..4, false)]);
        let said = LostPoses::sentence(&[lost(3..5, false)], Path::new("p.tum")).unwrap();
        assert!(
            said.starts_with("p.tum: poses fall back") && said.contains("of frames 3 to 4; "),
            "{said}"
        );
        assert!(said.contains("leave these lines out"), "{said}");
        let said = LostPoses::sentence(&[lost(4..5, true)], Path::new("p.tum")).unwrap();
        assert!(
            said.contains("those of frame 4; ") && said.contains("began again"),
            "{said}"
        );
    }

    /// A camera that waits at the start, and a plan that comes back step by step.
    #[test]
    fn right_poses_are_not_lost() {
        assert_eq!(found(&[]), []);
        assert_eq!(found(&[0.0, 0.0, 0.0, 1.0, 2.0]), []);
        assert_eq!(found(&[0.0, 1.0, 2.0, 1.0, 0.0, 1.0]), []);
        assert_eq!(found(&[0.0, 0.0, 0.0]), []);
        assert_eq!(LostPoses::sentence(&[], Path::new("p.tum")), None);
    }
}
