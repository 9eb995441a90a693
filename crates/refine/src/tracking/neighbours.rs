//! The frames around one that is registered, and those of them that share wall with it.

use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::samples::footprints::footprint;
use crate::tracking::unwrapped_frame::UnwrappedFrame;
use std::ops::Range;
use tunnelstitch_geometry::camera::Sweep;
use tunnelstitch_geometry::surface::Footprint;
use tunnelstitch_geometry::trajectory::Pose;

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
        let own = footprint(context, &context.camera, frame, pose)?.widened(margin_m);
        let frames = self.footprints.iter().zip(self.registered);
        let overlapping = frames.enumerate().map(|(k, (footprint, registered))| {
            *registered
                && self.frame_range.start + k != frame
                && footprint.overlaps(&own, perimeter)
        });
        Ok(overlapping.collect())
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
