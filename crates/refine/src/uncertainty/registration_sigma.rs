//! Uncertainty of the registration: of a frame against the wall that all frames show.
//!
//! The covariance of a pose is relative to the first frame and grows along the tunnel. What a
//! panorama, a crack or a change needs is that frames agree about the wall that they share. A point
//! of the wall is where the n frames that see it put it in the mean, and frame i is off by
//!
//! `r_i = (e_i − Σ_j e_j/n)`,  `e_j = A_j ξ_j + C_j κ + τ_j δ`,
//!
//! with the errors of poses, shared parameters and shape
//! ([`crate::uncertainty::total_covariance`]). What all of them do alike cancels. Where no other
//! frame sees the wall, there is nothing to be registered against.

use crate::model::context::EstimationContext;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::uncertainty::frame_sigma::wall_sigma_px;
use crate::uncertainty::pixel_jacobians::{PointJacobians, pixel_jacobians};
use crate::uncertainty::total_covariance::TotalCovariance;
use nalgebra::{Vector2, Vector3};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Hit, WallFrame};

/// Computes 1-σ of every frame against the wall that all show, pixels in the middle of the frame,
/// root mean square over the part of it that others show; NaN where it is unknown. `neighbours`: of
/// every frame, the frames that see part of the same wall.
pub fn registration_sigmas(
    context: &EstimationContext,
    estimates: &[FrameEstimate],
    neighbours: &[Vec<usize>],
    total: &TotalCovariance,
) -> Vec<f64> {
    (0..estimates.len()).par_map(|k| {
        let variance = |hit: &Hit, frame: &WallFrame| {
            let frames = (k, &neighbours[k][..]);
            let point = registration_jacobians(context, estimates, frames, hit, frame)?;
            Some(total.variance(&point))
        };
        wall_sigma_px(
            context.surface.as_ref(),
            context.cameras.of(k),
            &estimates[k].pose,
            variance,
        )
    })
}

/// Derivatives of `r_k` at the wall point `hit` of a pixel of frame k; None if no other frame sees
/// it.
fn registration_jacobians(
    context: &EstimationContext,
    estimates: &[FrameEstimate],
    (k, neighbours): (usize, &[usize]),
    hit: &Hit,
    frame: &WallFrame,
) -> Option<PointJacobians> {
    let sees = |j: &usize| is_seen(context, *j, &estimates[*j], &hit.x_w);
    let others: Vec<usize> = neighbours.iter().copied().filter(sees).collect();
    if others.is_empty() {
        return None;
    }
    let share = 1.0 / (1 + others.len()) as f64;
    let mut point = PointJacobians::default();
    let mut tau = Vector2::zeros();
    let mut add = |j: usize, share: f64| {
        let pixel = pixel_jacobians(context, (j, &estimates[j].pose), hit.wall, frame);
        point.add_pixel(j, &pixel, share);
        tau += pixel.tau * share;
    };
    add(k, 1.0 - share);
    for j in others {
        add(j, -share);
    }
    let model = context.shape.as_ref().map(|shape| &shape.model);
    point.add_wall(tau, hit.wall, model, estimates.len());
    Some(point)
}

/// True if a frame shows a point of the wall.
fn is_seen(
    context: &EstimationContext,
    frame: usize,
    estimate: &FrameEstimate,
    x_w: &Vector3<f64>,
) -> bool {
    let camera = context.cameras.of(frame);
    let pixel = camera.project(&estimate.pose.to_camera(x_w));
    pixel.is_some_and(|pixel| camera.is_in_image(&pixel, 0.0))
}
