//! Poses that belong to the frames some places later or earlier.

use super::error::SurveyError;
use super::interpreted_poses::InterpretedPoses;
use super::missing_poses::{self, MissingPoses};
use crate::frames::FrameFile;
use std::path::Path;
use tunnelstitch_geometry::trajectory::StampedPose;

/// Moves the poses of the file `path` to the frames `shift_frames` places later, earlier if it is
/// negative. Frames at the start or the end that have none then go on as their neighbours do
/// ([`missing_poses::complete`]).
///
/// # Errors
/// A shift by more than half of the frames; poses at an end that are turned too far from each other
/// to go on.
pub(super) fn shifted(
    read: InterpretedPoses,
    shift_frames: isize,
    path: &Path,
    frames: &[FrameFile],
) -> Result<InterpretedPoses, SurveyError> {
    let count = frames.len();
    let largest = (count / 2).min(count.saturating_sub(2));
    if shift_frames.unsigned_abs() > largest {
        return Err(SurveyError::Association {
            path: path.to_owned(),
            what: format!(
                "cannot be read with poses.shift_frames = {shift_frames} in survey.toml: at least \
                 half of the {count} frames, and two, must keep a pose; give a shift of at most \
                 {largest}"
            ),
        });
    }
    let is_in_gap = |k: &usize| read.gaps.iter().any(|gap| gap.frames.contains(k));
    let moved: Vec<Option<StampedPose>> = (0..count)
        .map(|k| {
            let own = k.checked_add_signed(shift_frames.checked_neg()?)?;
            let own = Some(own).filter(|own| !is_in_gap(own))?;
            Some(StampedPose {
                time_s: read.given[k].time_s,
                ..*read.given.get(own)?
            })
        })
        .collect();
    let times_s: Vec<f64> = read.given.iter().map(|stamped| stamped.time_s).collect();
    let interpolate = MissingPoses::Interpolate;
    let (given, gaps) =
        missing_poses::complete(path, frames, Some(&times_s), (&moved, None), interpolate)?;
    Ok(InterpretedPoses {
        given,
        gaps,
        ..read
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::missing_poses::PoseGap;
    use tunnelstitch_geometry::trajectory::{Convention, PoseFormat, spiral};

    /// Poses of a spiral at the times 10 + k, of which the file leaves some out.
    fn read(count: usize, gaps: Vec<PoseGap>) -> InterpretedPoses {
        let stamped = |(k, pose)| StampedPose {
            time_s: 10.0 + k as f64,
            pose,
        };
        let poses = spiral(count, 0.1, 0.2).into_iter();
        InterpretedPoses {
            of_pictures: false,
            given: poses.enumerate().map(stamped).collect(),
            convention: Convention::of(PoseFormat::Tum),
            format: PoseFormat::Tum,
            gaps,
            conflicts: Vec::new(),
        }
    }

    fn frames(count: usize) -> Vec<FrameFile> {
        let frame = |k: usize| FrameFile::picture(k, format!("{k}.png").into());
        (0..count).map(frame).collect()
    }

    /// A spiral goes on at its ends, so that a shift is one along it.
    #[test]
    fn poses_move_to_later_and_earlier_frames() {
        let long = spiral(14, 0.1, 0.2);
        for (shift, gap) in [(2, 0..2), (-3, 7..10)] {
            let poses = read(10, Vec::new());
            let moved = shifted(poses.clone(), shift, Path::new("p.tum"), &frames(10)).unwrap();
            assert_eq!(moved.gaps, [PoseGap { frames: gap }]);
            let step = long[0].inverse().after(&long[shift.unsigned_abs()]);
            for (k, (stamped, own)) in moved.given.iter().zip(&poses.given).enumerate() {
                let expected = if shift > 0 {
                    own.pose.after(&step.inverse())
                } else {
                    own.pose.after(&step)
                };
                assert!(stamped.pose.local(&expected).norm() < 1e-9, "{shift} {k}");
                assert!((stamped.time_s - own.time_s).abs() < 1e-9);
            }
        }
    }

    /// Frames that the file leaves out have none where its poses move to either.
    #[test]
    fn gaps_move_with_their_poses() {
        let poses = read(10, vec![PoseGap { frames: 4..6 }]);
        let moved = shifted(poses, 1, Path::new("p.tum"), &frames(10)).unwrap();
        let gaps: Vec<_> = moved.gaps.iter().map(|gap| gap.frames.clone()).collect();
        assert_eq!(gaps, [0..1, 5..7]);
    }

    #[test]
    fn half_of_the_frames_must_keep_a_pose() {
        for (count, shift, is_possible) in
            [(8, 4, true), (8, -5, false), (3, 1, true), (2, 1, false)]
        {
            let poses = read(count, Vec::new());
            let moved = shifted(poses, shift, Path::new("p.tum"), &frames(count));
            assert_eq!(moved.is_ok(), is_possible, "{count} {shift}");
        }
        let poses = read(8, Vec::new());
        let error = shifted(poses, isize::MIN, Path::new("p.tum"), &frames(8))
            .err()
            .unwrap();
        assert!(error.to_string().contains("at most 4"), "{error}");
    }
}
