//! The frames around one that is registered, and those of them that share wall with it.

use crate::comparison::unwrapped_frame::UnwrappedFrame;
use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::samples::footprints::footprint;
use std::ops::Range;
use tunnelstitch_geometry::camera::Sweep;
use tunnelstitch_geometry::surface::Footprint;
use tunnelstitch_geometry::trajectory::Pose;

/// Frames that a piece of the wall is fused from, at most, for registering another on it.
///
/// The texture of n frames has an n-th of a frame's noise, so that the pose has `1 + 1/n` times
/// the variance that it would have on a wall without noise. More frames take time and bring less
/// than a ninth of it.
const MAX_FUSED_FRAMES: usize = 8;

/// The frames around one that is registered; the slices are parallel to `frame_range`.
pub struct Neighbours<'s> {
    /// Consecutive frames, the one that is registered among them.
    pub frame_range: Range<usize>,
    /// Their estimates.
    pub estimates: &'s [FrameEstimate],
    /// Which of them are registered already and show the wall.
    pub registered: &'s [bool],
    /// The parts of the wall that they see.
    pub footprints: &'s [Footprint],
}

impl Neighbours<'_> {
    /// The motion of the camera while the rows of frame `frame` are read.
    pub fn sweep(&self, context: &EstimationContext, frame: usize) -> Sweep {
        context.sweep(frame, &self.frame_range, self.estimates)
    }

    /// Marks the registered frames that may share wall with frame `frame` at `pose`, its footprint
    /// widened by `margin_m` metres.
    ///
    /// Where more than [`MAX_FUSED_FRAMES`] show the middle of what it sees, only every second,
    /// third, … is marked, counted from the nearest in the sequence.
    ///
    /// # Errors
    /// [`ProblemError::Placement`] if `pose` lies outside the tunnel.
    pub fn find_overlapping(
        &self,
        context: &EstimationContext,
        frame: usize,
        pose: &Pose,
        margin_m: f64,
    ) -> Result<Vec<bool>, ProblemError> {
        let perimeter = context.surface.perimeter_m();
        let own = footprint(context, context.cameras.of(frame), frame, pose)?;
        let widened = own.widened(margin_m);
        let place = frame - self.frame_range.start;
        let mut found: Vec<usize> = (0..self.registered.len())
            .filter(|k| self.registered[*k] && *k != place)
            .filter(|k| self.footprints[*k].overlaps(&widened, perimeter))
            .collect();
        found.sort_by_key(|k| k.abs_diff(place));
        let middle = own.middle();
        let shows_middle = |k: &&usize| self.footprints[**k].contains(&middle, perimeter);
        let depth = found.iter().filter(shows_middle).count();
        let mut overlapping = vec![false; self.registered.len()];
        let step = depth.div_ceil(MAX_FUSED_FRAMES).max(1);
        for k in found.into_iter().step_by(step) {
            overlapping[k] = true;
        }
        Ok(overlapping)
    }

    /// Unwraps the `overlapping` frames at a pyramid level; returns them with their estimates.
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn unwrap_frames(
        &self,
        context: &EstimationContext,
        level: usize,
        overlapping: &[bool],
    ) -> Result<Vec<(UnwrappedFrame, FrameEstimate)>, ProblemError> {
        let mut unwrapped_frames = Vec::new();
        for (k, _) in (overlapping.iter().enumerate()).filter(|(_, overlaps)| **overlaps) {
            let frame = self.frame_range.start + k;
            let sweep = self.sweep(context, frame);
            let unwrapped = UnwrappedFrame::new(context, level, frame, &sweep)?;
            unwrapped_frames.push((unwrapped, self.estimates[k]));
        }
        Ok(unwrapped_frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::footprints::footprints;
    use crate::test_scene::with_context;
    use tunnelstitch_core::test_wall::{TestWall, waves};

    /// The frames that are marked for frame `frame` of these, all of them registered.
    fn marked(poses: &[Pose], frame: usize) -> Vec<usize> {
        let wall = TestWall::ring(waves);
        with_context(&wall, wall.frames(), poses, |context, states| {
            let neighbours = Neighbours {
                frame_range: 0..poses.len(),
                estimates: &states.estimates,
                registered: &vec![true; poses.len()],
                footprints: &footprints(context, states).unwrap(),
            };
            let found = neighbours.find_overlapping(context, frame, &poses[frame], 0.0);
            let found = found.unwrap().into_iter().enumerate();
            found
                .filter(|(_, marked)| *marked)
                .map(|(k, _)| k)
                .collect()
        })
    }

    #[test]
    fn all_that_overlap_are_marked_where_they_are_few() {
        let wall = TestWall::ring(waves);
        let found = marked(&wall.poses, 3);
        assert!(found.contains(&2) && found.contains(&4), "{found:?}");
        assert!(!found.contains(&3));
    }

    /// Of 24 that show the same wall, every third.
    #[test]
    fn a_few_are_marked_where_many_overlap() {
        let wall = TestWall::ring(waves);
        let found = marked(&vec![wall.poses[0]; 25], 24);
        assert_eq!(found, [2, 5, 8, 11, 14, 17, 20, 23]);
    }
}
