//! Consistency of stated covariances: normalised estimation errors squared (NEES).

use crate::error::EvaluateError;
use crate::error::check_pairs;
use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};
use tunnelstitch_geometry::surface::{GaugeMotion, Surface};
use tunnelstitch_geometry::trajectory::Pose;

/// Computes pose errors with the gauge fixed at the first pose.
///
/// Errors are the steps `ξ` from the estimated to the true poses ([`Pose::retract`]; rad, m). The
/// estimated poses are moved along the gauge until the first error has no component along it, just
/// as the first covariance has none.
///
/// # Errors
/// [`EvaluateError::Count`], [`EvaluateError::Empty`].
pub fn gauge_fixed_errors(
    surface: &dyn Surface,
    estimated: &[Pose],
    truth: &[Pose],
) -> Result<Vec<Vector6<f64>>, EvaluateError> {
    let motion = first_pose_gauge(surface, estimated, truth)?;
    let pairs = estimated.iter().zip(truth);
    Ok(pairs
        .map(|(estimate, truth)| motion.apply(estimate).local(truth))
        .collect())
}

/// The motion along the gauge after which the error of the first estimated pose has no component
/// along it.
///
/// # Errors
/// [`EvaluateError::Count`], [`EvaluateError::Empty`].
pub fn first_pose_gauge(
    surface: &dyn Surface,
    estimated: &[Pose],
    truth: &[Pose],
) -> Result<GaugeMotion, EvaluateError> {
    check_pairs(estimated.len(), truth.len())?;
    let gauge = surface.gauge();
    let mut motion = gauge.align(&estimated[..1], &truth[..1]);
    for _ in 0..MAX_GAUGE_ITERATIONS {
        let first = motion.apply(&estimated[0]);
        let error = first.local(&truth[0]);
        let directions = gauge.directions(&first);
        let [turn, shift] = match directions[..] {
            [turn, shift] => [turn, shift],
            [only] if gauge.turn => [only, Vector6::zeros()],
            [only] => [Vector6::zeros(), only],
            _ => break,
        };
        let normal = Matrix2::new(
            turn.dot(&turn).max(1e-12),
            turn.dot(&shift),
            turn.dot(&shift),
            shift.dot(&shift).max(1e-12),
        );
        let Some(inverse) = normal.try_inverse() else {
            break;
        };
        let step = inverse * Vector2::new(turn.dot(&error), shift.dot(&error));
        motion = motion.plus(1.0, &gauge.motion(step.x, step.y));
    }
    Ok(motion)
}

/// Maximum Newton iterations for the gauge motion; each squares the error.
const MAX_GAUGE_ITERATIONS: usize = 5;

/// Computes the normalised estimation errors squared, `ξᵀ Σ⁻¹ ξ`.
///
/// For true covariances they are distributed as χ² with 6 degrees of freedom, with mean 6. `None`
/// where the covariance is singular or unknown (as that of the first frame, which fixes the gauge).
///
/// Source: Y. Bar-Shalom, X. Li, T. Kirubarajan, "Estimation with Applications to Tracking and
/// Navigation", 2001, 5.4.
pub fn normalised_errors_squared(
    errors: &[Vector6<f64>],
    covariances: &[Matrix6<f64>],
) -> Vec<Option<f64>> {
    let pairs = errors.iter().zip(covariances).enumerate();
    pairs
        .map(|(k, (error, covariance))| {
            let solved = covariance.cholesky()?.solve(error);
            (k > 0).then(|| error.dot(&solved))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::spiral;

    #[test]
    fn the_gauge_is_no_error_and_the_rest_is() {
        let circle = Circle::new(3.0).unwrap();
        let truth = spiral(6, 0.1, 0.5);
        let motion = GaugeMotion::about_y(0.2, -1.0);
        let mut estimated = motion.apply_all(&truth);
        let xi = Vector6::new(1e-3, -2e-3, 5e-4, 1e-3, 2e-3, -1e-3);
        estimated[3] = estimated[3].retract(&xi);
        let errors = gauge_fixed_errors(&circle, &estimated, &truth).unwrap();
        assert!(errors[0].norm() < 1e-9 && errors[5].norm() < 1e-9);
        assert!((errors[3].fixed_rows::<3>(0) + xi.fixed_rows::<3>(0)).norm() < 1e-5);
        let covariance = vec![Matrix6::identity() * 1e-6; 6];
        let squares = normalised_errors_squared(&errors, &covariance);
        assert!(squares[0].is_none());
        assert!((squares[3].unwrap() / (xi.norm_squared() * 1e6) - 1.0).abs() < 1e-3);
    }
}
