//! The parts of the wall that frames see.

use crate::camera::Camera;
use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::problem_error::ProblemError;
use crate::surface::{Footprint, Surface};
use crate::trajectory::Pose;
use rayon::prelude::*;

/// How far back overlap is looked for, frames.
pub const MAX_OVERLAP_DISTANCE_FRAMES: usize = 256;
/// How far along the tunnel a frame is compared, in radii of a circle with the section's perimeter.
const REACH_RADII: f64 = 6.0;

/// How far along the tunnel a frame is compared, metres.
pub fn reach_m(surface: &dyn Surface) -> f64 {
    REACH_RADII * surface.perimeter_m() / std::f64::consts::TAU
}

/// What frame `frame` at `pose` sees of the wall through `camera`.
///
/// # Errors
/// [`ProblemError::Placement`].
pub fn footprint(
    scene: &EstimationContext,
    camera: &Camera,
    frame: usize,
    pose: &Pose,
) -> Result<Footprint, ProblemError> {
    Footprint::within(scene.surface, camera, pose, reach_m(scene.surface))
        .map_err(|source| ProblemError::Placement { frame, source })
}

/// What each frame sees of the wall at its present pose.
///
/// # Errors
/// [`ProblemError::Placement`].
pub fn footprints(
    scene: &EstimationContext,
    tracked: &FrameStates,
) -> Result<Vec<Footprint>, ProblemError> {
    let estimates = tracked.estimates.par_iter().enumerate();
    estimates
        .map(|(k, estimate)| {
            let camera = scene.camera.sweeping(&tracked.sweep(scene, k));
            footprint(scene, &camera, k, &estimate.pose)
        })
        .collect()
}
