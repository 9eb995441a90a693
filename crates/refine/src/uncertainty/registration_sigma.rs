//! Uncertainty of the registration: of a frame against those that show the same wall.
//!
//! The covariance of a single pose is relative to the first frame and grows along the tunnel. What
//! a panorama, a crack or a change needs is that frames agree about the wall that they share. If
//! frames j and k show the wall point x, the poses displace it by `A_j ξ_j` and `A_k ξ_k`
//! ([`wall_jacobian`]), and against each other by a vector of the covariance
//!
//! `A_k Σ_kk A_kᵀ + A_j Σ_jj A_jᵀ − A_k Σ_kj A_jᵀ − A_j Σ_jk A_kᵀ`.
//!
//! The σ of frame k is the root mean square over its partners j and the points that they share.

use crate::linear::normal_equations::Pattern;
use crate::model::context::EstimationContext;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::uncertainty::covariance::PairCovariances;
use nalgebra::Matrix6;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{viewing_distance, wall_jacobian};

/// Margin of the image within which a partner must see a point, pixels.
const MARGIN_PX: f64 = 0.0;

/// Computes 1-σ of every frame against those that show the same wall, pixels in the middle of the
/// frame; NaN for frames without partners.
pub fn registration_sigmas(
    context: &EstimationContext,
    pattern: &Pattern,
    pairs: &PairCovariances,
    estimates: &[FrameEstimate],
) -> Vec<f64> {
    let mut partners: Vec<Vec<usize>> = vec![Vec::new(); estimates.len()];
    for column in 0..pattern.frames() {
        for &row in pattern.rows(column).iter().filter(|row| **row != column) {
            partners[row].push(column);
            partners[column].push(row);
        }
    }
    let frame_sigma = |k: usize| {
        let (mut variance_m2, mut points) = (0.0, 0.0);
        for j in &partners[k] {
            let (sum_m2, count) = pair_variance(context, pattern, pairs, estimates, (k, *j));
            variance_m2 += sum_m2;
            points += count;
        }
        let pose = &estimates[k].pose;
        let distance_m = viewing_distance(context.surface, pose).unwrap_or(f64::NAN);
        f64::sqrt(variance_m2 / points) * context.camera.focal_px() / distance_m
    };
    (0..estimates.len()).par_map(frame_sigma)
}

/// Sum of the variances of the displacement of frame k against j over the points that both show,
/// square metres, and their number.
fn pair_variance(
    context: &EstimationContext,
    pattern: &Pattern,
    pairs: &PairCovariances,
    estimates: &[FrameEstimate],
    (k, j): (usize, usize),
) -> (f64, f64) {
    let block = |a: usize, b: usize| pairs.of_pair(pattern, a, b);
    let (Some(own), Some(other), Some(crossed)) = (block(k, k), block(j, j), block(k, j)) else {
        return (0.0, 0.0);
    };
    let [pose_k, pose_j] = [k, j].map(|frame| &estimates[frame].pose);
    let (mut variance_m2, mut points) = (0.0, 0.0);
    for ray_c in context.camera.grid_rays() {
        let Ok(hit) = context.surface.hit(&pose_k.t_wc, &(pose_k.r_wc * ray_c)) else {
            continue;
        };
        let wall = context.surface.frame(hit.wall);
        let seen = context.camera.project(&pose_j.to_camera(&wall.x_w));
        if seen.is_some_and(|pixel| context.camera.is_in_image(&pixel, MARGIN_PX)) {
            let (a_k, a_j) = (wall_jacobian(pose_k, &wall), wall_jacobian(pose_j, &wall));
            let of = |left, covariance: &Matrix6<f64>, right: nalgebra::Matrix2x6<f64>| {
                let left: nalgebra::Matrix2x6<f64> = left;
                (left * covariance * right.transpose()).trace()
            };
            variance_m2 +=
                of(a_k, &own, a_k) + of(a_j, &other, a_j) - 2.0 * of(a_k, &crossed, a_j);
            points += 1.0;
        }
    }
    (variance_m2, points)
}
