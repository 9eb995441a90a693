//! How sure the estimate is: marginal covariance of every frame from the sparse factor.

use super::estimate::FrameEstimate;
use super::factor::{FactorError, Symbolic};
use super::normal::{NormalEquations, Pattern};
use crate::camera::Pinhole;
use crate::surface::{Surface, wall_jacobian};
use nalgebra::Matrix6;
use rayon::prelude::*;

/// 1-σ of one frame, with the two gauge freedoms fixed at the first frame.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct FrameSigma {
    /// Rotation, root mean square over the three axes, degrees.
    pub rotation_deg: f64,
    /// Translation, root mean square over the three axes, metres.
    pub translation_m: f64,
    /// Position on the wall of what the frame shows: root mean square over middle and corners, metres.
    pub wall_m: f64,
    /// The same in pixels of the frame.
    pub wall_px: f64,
}

/// The covariance of every frame's pose: diagonal blocks of `H⁻¹` with H the normal matrix at the estimate
/// (pixels weighted by their noise, plus prior, the gauge tied at the first frame).
///
/// # Errors
/// [`FactorError`] if the normal matrix is singular.
pub fn frame_covariances(
    pattern: &Pattern,
    symbolic: &Symbolic,
    normal: &NormalEquations,
) -> Result<Vec<Matrix6<f64>>, FactorError> {
    let factor = symbolic.factorise(pattern, normal, 0.0)?;
    Ok((0..pattern.frames())
        .into_par_iter()
        .map(|k| factor.marginal(k).fixed_view::<6, 6>(0, 0).into_owned())
        .collect())
}

/// Reads a pose covariance as σ of rotation, translation and wall position.
pub fn frame_sigma(
    surface: &dyn Surface,
    camera: &Pinhole,
    estimate: &FrameEstimate,
    covariance: &Matrix6<f64>,
) -> FrameSigma {
    let pose = &estimate.pose;
    let trace = |first: usize| {
        (0..3)
            .map(|k| covariance[(first + k, first + k)])
            .sum::<f64>()
    };
    let mut wall = 0.0;
    let mut wall_px = 0.0;
    let mut points = 0.0;
    let middle = nalgebra::Vector2::new(camera.cx, camera.cy);
    for pixel in camera.border(1, 0.0).iter().chain([&middle]) {
        let ray = pose.r_wc * camera.ray(pixel.x, pixel.y);
        if let Ok(hit) = surface.hit(&pose.t_wc, &ray) {
            let a = wall_jacobian(pose, &surface.frame(hit.wall));
            let variance = (a * covariance * a.transpose()).trace();
            wall += variance;
            wall_px += variance * (camera.fy / hit.range).powi(2);
            points += 1.0;
        }
    }
    FrameSigma {
        rotation_deg: (trace(0) / 3.0).sqrt().to_degrees(),
        translation_m: (trace(3) / 3.0).sqrt(),
        wall_m: (wall / points).sqrt(),
        wall_px: (wall_px / points).sqrt(),
    }
}
