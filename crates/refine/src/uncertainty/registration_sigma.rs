//! Uncertainty of the registration: of a frame against the wall that the others show.
//!
//! The covariance of a pose is relative to the first frame and grows along the tunnel. What a
//! panorama, a crack or a change needs is that frames agree about the wall that they share: the
//! uncertainty of a frame with all others held, `c (H_kk⁻¹)_pp`, c the dispersion of the pixels'
//! scores, model errors included. It counts over the whole picture: a frame that shares only a
//! strip with others is registered there, and uncertain elsewhere.

use crate::model::context::EstimationContext;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::solver::gauss_newton::Solution;
use crate::uncertainty::frame_sigma::compute_frame_sigma;

/// Computes 1-σ of every frame with all others held, pixels in the middle of the frame; NaN where
/// they do not determine its pose. `dispersion`: c.
pub fn registration_sigmas(
    context: &EstimationContext,
    solution: &Solution,
    dispersion: f64,
) -> Vec<f64> {
    let pattern = solution.problem.pattern();
    let of_frame = |(k, estimate): (usize, &FrameEstimate)| {
        let block = &solution.linearisation.normal.blocks[pattern.block_index(k, k)?];
        let inverse = block.cholesky()?.inverse();
        let covariance = dispersion * inverse.fixed_view::<6, 6>(0, 0);
        let (surface, camera) = (context.surface.as_ref(), &context.camera);
        Some(compute_frame_sigma(surface, camera, estimate, &covariance).wall_px)
    };
    let frames = solution.unknowns.frames.iter().enumerate();
    frames
        .map(|frame| of_frame(frame).unwrap_or(f64::NAN))
        .collect()
}
