//! Footprints: the parts of the wall that frames observe.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Footprint;
use tunnelstitch_geometry::trajectory::Pose;

/// Distance up to which a camera on the axis resolves the wall, radii of a circle with the
/// section's perimeter.
///
/// At an angle φ to the section the wall is `1/cos φ` away, and `cos³ φ` of the pixels are left:
/// here a twentieth.
pub const RESOLVED_RANGE_RADII: f64 = 2.7;
/// Least area of a piece of the wall in a frame, over that when it is seen squarely from the axis,
/// for being resolved: `cos³ φ` at [`RESOLVED_RANGE_RADII`].
pub const MIN_RESOLVED_SHARE: f64 =
    1.0 / (RESOLVED_RANGE_RADII * RESOLVED_RANGE_RADII * RESOLVED_RANGE_RADII);

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
    Footprint::trace(context.surface.as_ref(), camera, pose)
        .map_err(|source| ProblemError::Placement { frame, source })
}

/// Chainages between which some footprints lie, metres.
pub fn extent_h_m(footprints: &[Footprint]) -> [f64; 2] {
    let nothing = [f64::INFINITY, f64::NEG_INFINITY];
    footprints.iter().fold(nothing, |[from, to], one| {
        [from.min(one.h_min_m), to.max(one.h_max_m)]
    })
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
        let camera = context.cameras.of(k).with_sweep(&frames.sweep(context, k));
        footprint(context, &camera, k, &frames.estimates[k].pose)
    });
    footprints.into_iter().collect()
}
