//! Uncertainty of one frame, stated as σ of rotation, translation and wall position.

use crate::parameters::frame_estimate::FrameEstimate;
use nalgebra::Matrix6;
use serde::{Deserialize, Deserializer};
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{
    Hit, Surface, WallFrame, sighted_wall, viewing_distance, wall_jacobian,
};
use tunnelstitch_geometry::trajectory::Pose;

/// 1-σ of one frame, with the two gauge freedoms fixed at the first frame.
///
/// All are NaN where the equations are singular.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub struct FrameSigma {
    /// Rotation, root mean square over the three axes, degrees.
    #[serde(deserialize_with = "nan_if_null")]
    pub rotation_deg: f64,
    /// Translation, root mean square over the three axes, metres.
    #[serde(deserialize_with = "nan_if_null")]
    pub translation_m: f64,
    /// Position on the wall, root mean square over the picture ([`Camera::grid_rays`]), metres.
    #[serde(deserialize_with = "nan_if_null")]
    pub wall_m: f64,
    /// Position on the wall in pixels at the middle of the frame, as `evaluate::WallError`
    /// counts them.
    #[serde(deserialize_with = "nan_if_null")]
    pub wall_px: f64,
    /// Position on the wall as the other frames show it, root mean square over the picture, pixels
    /// ([`crate::uncertainty::registration_sigma`]).
    #[serde(default = "unknown", deserialize_with = "nan_if_null")]
    pub registration_px: f64,
}

impl FrameSigma {
    /// Unknown 1-σ: NaN.
    pub(crate) fn unknown() -> Self {
        Self {
            rotation_deg: f64::NAN,
            translation_m: f64::NAN,
            wall_m: f64::NAN,
            wall_px: f64::NAN,
            registration_px: f64::NAN,
        }
    }
}

/// A number that a file of an earlier version does not have.
fn unknown() -> f64 {
    f64::NAN
}

/// Reads a number that may be NaN, which JSON writes as null.
fn nan_if_null<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// Computes σ of rotation, translation and wall position from the covariance of a pose alone.
pub fn compute_frame_sigma(
    surface: &dyn Surface,
    camera: &Camera,
    estimate: &FrameEstimate,
    covariance: &Matrix6<f64>,
) -> FrameSigma {
    let pose = &estimate.pose;
    let variance = |_: &Hit, frame: &WallFrame| {
        let a = wall_jacobian(pose, frame);
        Some((a * covariance * a.transpose()).trace())
    };
    compute_frame_sigma_by(surface, camera, estimate, covariance, variance)
}

/// Computes σ of rotation and translation from the covariance of a pose, and that of the wall
/// position from the `variance` of wall points, as [`wall_sigma_m`].
pub fn compute_frame_sigma_by(
    surface: &dyn Surface,
    camera: &Camera,
    estimate: &FrameEstimate,
    covariance: &Matrix6<f64>,
    variance: impl Fn(&Hit, &WallFrame) -> Option<f64>,
) -> FrameSigma {
    let trace = |first: usize| {
        (0..3)
            .map(|k| covariance[(first + k, first + k)])
            .sum::<f64>()
    };
    let wall_m = wall_sigma_m(surface, camera, &estimate.pose, variance);
    FrameSigma {
        rotation_deg: (trace(0) / 3.0).sqrt().to_degrees(),
        translation_m: (trace(3) / 3.0).sqrt(),
        wall_m,
        wall_px: wall_m * px_per_metre(surface, camera, &estimate.pose),
        registration_px: f64::NAN,
    }
}

/// Computes 1-σ of the wall points that a frame shows, root mean square over the picture, metres,
/// from their `variance` (m², along s and h together); points without one do not count.
fn wall_sigma_m(
    surface: &dyn Surface,
    camera: &Camera,
    pose: &Pose,
    variance: impl Fn(&Hit, &WallFrame) -> Option<f64>,
) -> f64 {
    let (mut sum, mut points) = (0.0, 0.0);
    for ray_c in camera.grid_rays() {
        let hit = sighted_wall(surface, camera, pose, &ray_c).ok();
        if let Some(variance) = hit.and_then(|hit| variance(&hit, &surface.frame(hit.wall))) {
            sum += variance;
            points += 1.0;
        }
    }
    f64::sqrt(sum / points)
}

/// Computes 1-σ as [`wall_sigma_m`] does, in pixels at the middle of the frame.
pub fn wall_sigma_px(
    surface: &dyn Surface,
    camera: &Camera,
    pose: &Pose,
    variance: impl Fn(&Hit, &WallFrame) -> Option<f64>,
) -> f64 {
    wall_sigma_m(surface, camera, pose, variance) * px_per_metre(surface, camera, pose)
}

/// Pixels per metre of wall where a frame sees it best.
fn px_per_metre(surface: &dyn Surface, camera: &Camera, pose: &Pose) -> f64 {
    camera.focal_px() / viewing_distance(surface, camera, pose).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::so3;

    /// A camera with an error of a millimetre along the tunnel displaces all of the wall by a
    /// millimetre; in pixels it is measured at the middle, even where the corners are far away.
    #[test]
    fn wall_sigma_in_pixels_is_measured_at_the_middle() {
        let circle = tunnelstitch_geometry::surface::Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(160, 120, 40f64.to_radians());
        let mut covariance = Matrix6::zeros();
        covariance[(4, 4)] = 1e-6;
        for (tilt_deg, distance_m) in [(0.0, 3.0), (45.0f64, 3.0 * 2f64.sqrt())] {
            let tilt = nalgebra::Vector3::x() * tilt_deg.to_radians();
            let pose = Pose::new(so3::exp(&tilt), nalgebra::Vector3::zeros());
            let estimate = FrameEstimate::at(pose);
            let sigma = compute_frame_sigma(&circle, &camera, &estimate, &covariance);
            assert!((sigma.wall_m - 1e-3).abs() < 1e-9, "{sigma:?}");
            let expected = 1e-3 * camera.fy / distance_m;
            assert!((sigma.wall_px - expected).abs() < 1e-6, "{sigma:?}");
        }
    }
}
