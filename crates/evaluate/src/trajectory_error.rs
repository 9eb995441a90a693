//! Pose errors after removing the gauge.

use crate::error::EvaluateError;
use crate::error::check_pairs;
use crate::error_statistics::ErrorStatistics;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::surface::{Gauge, GaugeMotion};
use tunnelstitch_geometry::trajectory::Pose;

/// Pose errors after removing only the tunnel's gauge.
///
/// A similarity fit (Umeyama) would also hide errors that are observable in the images, such as an
/// offset from the axis or a wrong scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TrajectoryError {
    /// Gauge motion that was removed.
    pub gauge: GaugeMotion,
    /// Rotation error: angle of `R_trueᵀ R_est`, degrees.
    pub rotation_deg: ErrorStatistics,
    /// Translation error: `|t_est − t_true|`, metres.
    pub translation_m: ErrorStatistics,
    /// Rotation error of each frame, degrees.
    pub frame_rotation_deg: Vec<f64>,
    /// Translation error of each frame, metres.
    pub frame_translation_m: Vec<f64>,
}

/// Compares poses with the true ones, frame by frame, after aligning them along `gauge`.
///
/// # Errors
/// [`EvaluateError::Count`], [`EvaluateError::Empty`].
pub fn trajectory_error(
    gauge: Gauge,
    estimated: &[Pose],
    truth: &[Pose],
) -> Result<TrajectoryError, EvaluateError> {
    check_pairs(estimated.len(), truth.len())?;
    let motion = gauge.align(estimated, truth);
    let (mut frame_rotation_deg, mut frame_translation_m) = (Vec::new(), Vec::new());
    for (estimate, truth) in estimated.iter().zip(truth) {
        let aligned = motion.apply(estimate);
        frame_rotation_deg.push(truth.r_wc.angle_to(&aligned.r_wc).to_degrees());
        frame_translation_m.push((aligned.t_wc - truth.t_wc).norm());
    }
    Ok(TrajectoryError {
        gauge: motion,
        rotation_deg: ErrorStatistics::of(&frame_rotation_deg),
        translation_m: ErrorStatistics::of(&frame_translation_m),
        frame_rotation_deg,
        frame_translation_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use tunnelstitch_geometry::surface::{Circle, Surface};
    use tunnelstitch_geometry::trajectory::{so3, spiral};

    #[test]
    fn known_errors_are_measured_and_the_gauge_is_not() {
        let truth = spiral(10, 0.1, 0.5);
        let gauge = GaugeMotion::about_y(0.4, 2.0);
        let both = Circle::new(3.0).unwrap().gauge();
        let mut estimated = gauge.apply_all(&truth);
        let error = trajectory_error(both, &estimated, &truth).unwrap();
        assert!(error.rotation_deg.max < 1e-6 && error.translation_m.max < 1e-12);
        // One frame is tilted by 1° about a normal of its viewing axis and shifted by 10 mm off the
        // tunnel's axis; the gauge contains neither.
        estimated[3].r_wc *= so3::exp(&(Vector3::x() * 1f64.to_radians()));
        estimated[3].t_wc.x += 0.010;
        let error = trajectory_error(both, &estimated, &truth).unwrap();
        assert!((error.frame_rotation_deg[3] - 1.0).abs() < 1e-3);
        assert!((error.frame_translation_m[3] - 0.010).abs() < 1e-4);
        assert!((error.rotation_deg.rms - 1.0 / 10f64.sqrt()).abs() < 1e-3);
        assert!(error.rotation_deg.median < 1e-3);
    }
}
