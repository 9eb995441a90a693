//! Footprints: the parts of the wall that frames observe.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::thresholds::footprints::MAX_REACH_RADII;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Footprint, Surface};
use tunnelstitch_geometry::trajectory::Pose;

/// Largest distance along the tunnel at which a frame is compared, metres.
pub fn reach_m(surface: &dyn Surface) -> f64 {
    MAX_REACH_RADII * surface.perimeter_m() / std::f64::consts::TAU
}

/// Footprint of frame `frame` at `pose`, taken by `camera`.
///
/// # Errors
/// [`ProblemError::Placement`].
pub fn footprint(
    context: &EstimationContext,
    camera: &Camera,
    frame: usize,
    pose: &Pose,
) -> Result<Footprint, ProblemError> {
    Footprint::within(context.surface, camera, pose, reach_m(context.surface))
        .map_err(|source| ProblemError::Placement { frame, source })
}

/// Footprint of each frame at its current pose.
///
/// # Errors
/// [`ProblemError::Placement`].
pub fn footprints(
    context: &EstimationContext,
    frames: &FrameStates,
) -> Result<Vec<Footprint>, ProblemError> {
    let footprints = (0..frames.estimates.len()).par_map(|k| {
        let camera = context.camera.with_sweep(&frames.sweep(context, k));
        footprint(context, &camera, k, &frames.estimates[k].pose)
    });
    footprints.into_iter().collect()
}
