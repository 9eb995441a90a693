//! Footprints: the parts of the wall that frames observe.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Footprint, Surface};
use tunnelstitch_geometry::trajectory::Pose;

/// Largest distance along the tunnel at which a camera on the axis resolves the wall, radii of a
/// circle with the section's perimeter.
///
/// At an angle φ to the section `cos³ φ` of the pixels are left: the share
/// [`crate::thresholds::visibility::MIN_RELATIVE_SAMPLE_AREA`] at `tan φ = √(0.05^(−2/3) − 1)`.
pub const RESOLVED_REACH_RADII: f64 = 2.5;

/// Viewing distance of the farthest wall that is resolved, radii: `√(1 + 2.5²)`. The size of pixels
/// on the wall, and so the lattices for frames that look along the tunnel, are bounded to it.
pub const MAX_VIEWING_DISTANCE_RADII: f64 = 2.7;

/// Largest distance along the tunnel at which a frame is compared, radii.
///
/// If the lattice is laid out for the viewing distance D, a sample at distance d has the relative
/// area `D² p/d³` in a frame, p the camera's distance from the line of wall. With D = 2.7, the area
/// falls below 0.05 beyond `√(d² − p²)` = 5.8 for a camera half a radius off the axis, p = 1.5.
const MAX_REACH_RADII: f64 = 6.0;

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
    Footprint::within(
        context.surface.as_ref(),
        camera,
        pose,
        reach_m(context.surface.as_ref()),
    )
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
        let camera = context.camera.with_sweep(&frames.sweep(context, k));
        footprint(context, &camera, k, &frames.estimates[k].pose)
    });
    footprints.into_iter().collect()
}
