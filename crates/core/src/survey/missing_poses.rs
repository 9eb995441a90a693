//! Poses of frames that a file of poses leaves out: by their neighbours in the sequence.

use super::error::SurveyError;
use crate::frames::FrameFile;
use std::ops::Range;
use std::path::Path;
use tunnelstitch_geometry::files::{escape_controls, printed};
use tunnelstitch_geometry::trajectory::{StampedPose, Trajectory, se3};

/// Most names of frames in a message.
const MAX_NAMED_FRAMES: usize = 5;

/// Treatment of frames without a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MissingPoses {
    /// An error: the poses are a result, or the truth.
    Refuse,
    /// They start between their neighbours.
    Interpolate,
}

/// Frames without a pose of their own, in a row.
///
/// Their initial poses are interpolated between the frames beside them ([`se3::between`]), or
/// extrapolated at the start and the end of the sequence by the neighbouring step. Steps of such
/// frames are as uncertain as the whole gap: a random walk over `n + 1` steps leads across `n`
/// frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PoseGap {
    /// The frames.
    pub frames: Range<usize>,
}

impl PoseGap {
    /// Steps from the pose before the gap to the one after it: the factor of the variance of a
    /// step into, within or out of the gap.
    pub fn steps(&self) -> usize {
        self.frames.len() + 1
    }
}

/// Runs of frames without a pose.
fn gaps<T>(poses: &[Option<T>]) -> Vec<PoseGap> {
    let mut gaps: Vec<PoseGap> = Vec::new();
    for (k, _) in poses.iter().enumerate().filter(|(_, pose)| pose.is_none()) {
        match gaps.last_mut() {
            Some(gap) if gap.frames.end == k => gap.frames.end = k + 1,
            _ => gaps.push(PoseGap { frames: k..k + 1 }),
        }
    }
    gaps
}

/// True if so many known poses suffice to place `frames` between them.
pub(super) fn are_enough(known: usize, frames: usize) -> bool {
    known >= 2 && 2 * known >= frames
}

/// Completes the poses of the file `path`, whose first pose is that of `first_name`, at the frames
/// that it leaves out. `times_s`: the frames' times, if given by a file or a video; else a frame's
/// share of the way counts frames.
///
/// # Errors
/// Poses of fewer than half of the frames, or of fewer than two, or missing ones that are to be
/// refused; poses beside a gap that are turned too far from each other.
pub(super) fn complete(
    path: &Path,
    frames: &[FrameFile],
    times_s: Option<&[f64]>,
    (poses, first_name): (&[Option<StampedPose>], Option<&str>),
    missing: MissingPoses,
) -> Result<(Trajectory, Vec<PoseGap>), SurveyError> {
    let fail = |what: String| SurveyError::Association {
        path: path.to_owned(),
        what,
    };
    let gaps = gaps(poses);
    let known: Vec<(usize, StampedPose)> = poses
        .iter()
        .enumerate()
        .filter_map(|(k, pose)| Some((k, (*pose)?)))
        .collect();
    let may_miss = missing == MissingPoses::Interpolate && are_enough(known.len(), poses.len());
    if !gaps.is_empty() && !may_miss {
        let remedy = match missing {
            MissingPoses::Refuse => String::new(),
            MissingPoses::Interpolate => {
                let example = first_name.map_or(String::new(), |name| {
                    format!(
                        "; the file names frames such as `{}`",
                        escape_controls(name)
                    )
                });
                format!("; at least half of the frames, and two, must have one{example}")
            }
        };
        let without = poses.len() - known.len();
        return Err(fail(format!(
            "no pose of {}{remedy}",
            named(frames, &gaps, without)
        )));
    }
    let clock = |k: usize| {
        let given = times_s.and_then(|times_s| times_s.get(k).copied());
        given.unwrap_or(k as f64)
    };
    let pose = |(k, pose): (usize, &Option<StampedPose>)| {
        if let Some(pose) = pose {
            return Ok(*pose);
        }
        // The poses beside the frame, or the two nearest to it on one side.
        let after = known.partition_point(|(other, _)| *other < k);
        let first = after.clamp(1, known.len() - 1) - 1;
        let [(a, from), (b, to)] = [known[first], known[first + 1]];
        let share = (clock(k) - clock(a)) / (clock(b) - clock(a));
        let pose = se3::between(&from.pose, &to.pose, share).ok_or_else(|| {
            fail(format!(
                "no pose of frame {k} ({}), and the poses of frames {a} and {b} are turned too \
                 far from each other to find the way between them; give it a pose, or leave it \
                 out of frames.images",
                printed(&frames[k].path)
            ))
        })?;
        Ok(StampedPose {
            time_s: from.time_s + share * (to.time_s - from.time_s),
            pose,
        })
    };
    let completed = poses.iter().enumerate().map(pose);
    Ok((completed.collect::<Result<_, SurveyError>>()?, gaps))
}

/// The warning about gaps in the file `path`, if there are any.
pub(super) fn warning(path: &Path, frames: &[FrameFile], gaps: &[PoseGap]) -> Option<String> {
    let count: usize = gaps.iter().map(|gap| gap.frames.len()).sum();
    (count > 0).then(|| {
        format!(
            "{}: no pose of {}; they start between their neighbours in the sequence, with a \
             wider prior (give them poses, or leave them out of frames.images)",
            printed(path),
            named(frames, gaps, count)
        )
    })
}

/// The first frames without a pose by index and name, and the number of the others.
fn named(frames: &[FrameFile], gaps: &[PoseGap], count: usize) -> String {
    let first = gaps.iter().flat_map(|gap| gap.frames.clone());
    let first: Vec<String> = first
        .take(MAX_NAMED_FRAMES)
        .map(|k| format!("frame {k} ({})", printed(&frames[k].path)))
        .collect();
    let others = count - first.len();
    let more = if others > 0 {
        format!(" and {others} more")
    } else {
        String::new()
    };
    let names = first.join(", ");
    if count > 1 {
        format!("{names}{more}, {count} of {} frames", frames.len())
    } else {
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::spiral;

    fn frames(count: usize) -> Vec<FrameFile> {
        let frame = |k: usize| FrameFile::picture(k, format!("{k}.png").into());
        (0..count).map(frame).collect()
    }

    /// A spiral at the times 10 + k without the poses of some frames.
    fn poses(count: usize, without: &[usize]) -> Vec<Option<StampedPose>> {
        let pose = |(k, pose)| {
            let time_s = 10.0 + k as f64;
            (!without.contains(&k)).then_some(StampedPose { time_s, pose })
        };
        let all = spiral(count, 0.1, 0.2);
        all.into_iter().enumerate().map(pose).collect()
    }

    fn completed(
        count: usize,
        without: &[usize],
        missing: MissingPoses,
    ) -> Result<(Trajectory, Vec<PoseGap>), SurveyError> {
        let poses = poses(count, without);
        complete(
            Path::new("images.txt"),
            &frames(count),
            None,
            (&poses, Some("a.png")),
            missing,
        )
    }

    /// A screw motion is met within a gap, before the first and after the last pose.
    #[test]
    fn a_spiral_goes_on_through_its_gaps() {
        let without = [0, 3, 4, 8, 9];
        let (found, gaps) = completed(10, &without, MissingPoses::Interpolate).unwrap();
        let steps: Vec<_> = gaps
            .iter()
            .map(|gap| (gap.frames.clone(), gap.steps()))
            .collect();
        assert_eq!(steps, [(0..1, 2), (3..5, 3), (8..10, 3)]);
        for (found, expected) in found.iter().zip(poses(10, &[])) {
            let expected = expected.unwrap();
            assert!(found.pose.local(&expected.pose).norm() < 1e-9);
            assert!((found.time_s - expected.time_s).abs() < 1e-9);
        }
        let said = warning(Path::new("images.txt"), &frames(10), &gaps).unwrap();
        assert!(
            said.contains("no pose of frame 0 (0.png), frame 3 (3.png)"),
            "{said}"
        );
        assert_eq!(warning(Path::new("images.txt"), &frames(10), &[]), None);
    }

    /// The times of frames say how far on the way one is.
    #[test]
    fn known_times_weigh_the_neighbours() {
        let times_s = [0.0, 1.5, 2.0];
        let poses = poses(3, &[1]);
        let (found, _) = complete(
            Path::new("images.txt"),
            &frames(3),
            Some(&times_s),
            (&poses, None),
            MissingPoses::Interpolate,
        )
        .unwrap();
        let expected = spiral(9, 0.025, 0.05)[6];
        assert!(found[1].pose.local(&expected).norm() < 1e-12);
        assert_eq!(found[1].time_s, 11.5);
    }

    #[test]
    fn half_of_the_frames_must_have_a_pose() {
        let interpolate = MissingPoses::Interpolate;
        assert!(completed(4, &[1, 2], interpolate).is_ok());
        for (count, without, missing, expected) in [
            (
                4,
                &[1, 2, 3][..],
                interpolate,
                "the file names frames such as `a.png`",
            ),
            (2, &[1], interpolate, "no pose of frame 1 (1.png); at least"),
            (
                20,
                &[0, 1, 2, 3, 4, 5, 7, 9, 11, 13, 15],
                interpolate,
                "and 6 more, 11 of 20",
            ),
            (5, &[3], MissingPoses::Refuse, "no pose of frame 3 (3.png)"),
        ] {
            let error = completed(count, without, missing).unwrap_err();
            let message = error.to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
